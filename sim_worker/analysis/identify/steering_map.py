"""Steering-wheel over effective tyre angle, binned by speed."""

from __future__ import annotations

import itertools

import numpy as np

from foretwin.contracts.tuning import SteeringMapBin
from foretwin.sim_worker.analysis.identify.regression import fit_linear
from foretwin.sim_worker.analysis.identify.steering import SteeringFit
from foretwin.sim_worker.analysis.motion_record import MotionRecord

EDGES_MPS = (2.0, 5.0, 8.0, 11.0, 15.0, 20.0, 30.0, 45.0)
_LEAST_TYRE_RAD = 0.01
_LEAST_S, _ALIKE_S = 2.0, 0.5


def steering_map(record: MotionRecord, fit: SteeringFit) -> tuple[SteeringMapBin, ...]:
    """Return the ratio in each range of speeds with 2 s of turning at least.

    A ratio that falls with speed in spite of the fitted understeer tells of variable-ratio
    steering; `fit` is that of the same `record`.
    """
    period_s = float(record.time_s[1])
    signals, values = fit.signals, fit.fit.values
    at = signals.used
    speed, wheel = signals.speed_mps[at], signals.late_wheel_rad(values)[at]
    tyre = signals.steered_rad(values)[at]
    bins = []
    for low, high in itertools.pairwise(EDGES_MPS):
        inside = (speed >= low) & (speed < high) & (np.abs(tyre) > _LEAST_TYRE_RAD)
        if inside.sum() * period_s < _LEAST_S:
            continue
        time_s = record.time_s[at][inside]
        try:
            line = fit_linear(wheel[inside][:, None], tyre[inside], time_s, length_s=_ALIKE_S)
        except ValueError:
            continue
        inverse, half = float(line.values[0]), line.half_width(0)
        if inverse <= half:
            continue
        bins.append(
            SteeringMapBin(
                from_mps=low, to_mps=high, ratio=1.0 / inverse, low=1.0 / (inverse + half),
                high=1.0 / (inverse - half), samples=int(inside.sum()),
            )
        )  # fmt: skip
    return tuple(bins)
