"""When a departure began, within the stretch that shows it."""

from __future__ import annotations

import numpy as np

from foretwin.contracts.arrays import Array
from foretwin.sim_worker.analysis.gap.consistency import Consistency
from foretwin.sim_worker.analysis.gap.pairs import SignalPairs
from foretwin.sim_worker.analysis.motion_record import PERIOD_S

_SHARE = 0.25
"""Of the mean departure: what counts as one."""
_USUAL_LAG_S = 0.1


def began_ns(pairs: SignalPairs, seen: Consistency, evidence: str) -> int:
    """Return since when the pair behind a piece of evidence has departed from agreement.

    The change point of Page's test (1954): where the sum of what departs beyond its allowance was
    last at its lowest.
    """
    lag_s = 0.0
    if evidence.startswith(("speed", "gyro")):
        speed = evidence.startswith("speed")
        x, y = (
            (pairs.ground_mps, pairs.wheel_mps) if speed else (pairs.course_radps, pairs.gyro_radps)
        )
    elif evidence.startswith("model"):
        x, y = pairs.commanded_rad, pairs.model_tire_rad
        lag_s = _usual(seen.measured_by_command.delay_s if seen.measured_by_command else 0.0)
    elif evidence.startswith("measured"):
        x, y = pairs.asked_rad, pairs.done_rad
        lag_s = _usual(seen.measured_by_command.delay_s if seen.measured_by_command else 0.0)
    elif evidence == "motion_by_angle":
        x, y = pairs.done_rad, pairs.arc_rad
    else:
        x, y = pairs.by_measured_pm, pairs.curvature_pm
    late = round(lag_s / PERIOD_S)
    apart = np.nan_to_num(y[late:] - x[: len(x) - late])
    return int(pairs.stamp_ns[late + change_index(np.asarray(apart**2))])


def change_index(departure: Array) -> int:
    """Return the index (N,) from which a departure, which is never negative, has been there."""
    summed = np.cumsum(departure - _SHARE * float(np.mean(departure)))
    lowest = int(np.argmin(np.concatenate([[0.0], summed[:-1]])))
    return min(lowest, len(departure) - 1)


def _usual(delay_s: float) -> float:
    return delay_s if delay_s < 0.36 else _USUAL_LAG_S
