"""Pictures of an identification: estimates with intervals, and what the steering was fitted to."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from foretwin.contracts.tuning import Identification
from foretwin.contracts.vehicle import VehicleParameters
from foretwin.sim_worker.analysis.identify.steering import fit_steering
from foretwin.sim_worker.analysis.identify.steering_signals import Theta
from foretwin.sim_worker.analysis.motion_record import MotionRecord

_TAKEN, _LEFT = "#1f77b4", "#b0b0b0"


def draw_estimates(result: Identification, file: Path) -> bool:
    """Write a PNG: each parameter's interval, blue where it is taken, and the value in force.

    Returns whether there is one; none is drawn where no parameter was estimated.
    """
    shown = [found for found in result.estimates if found.value is not None]
    if not shown:
        return False
    columns = min(4, len(shown))
    rows = -(-len(shown) // columns)
    figure = Figure(figsize=(3.2 * columns, 2.0 * rows), layout="constrained")
    FigureCanvasAgg(figure)
    for index, found in enumerate(shown, start=1):
        assert found.value is not None
        assert found.low is not None
        assert found.high is not None
        axes = figure.add_subplot(rows, columns, index)
        colour = _LEFT if found.reason else _TAKEN
        reach = [[found.value - found.low], [found.high - found.value]]
        axes.errorbar([found.value], [0.0], xerr=reach, fmt="o", color=colour, capsize=4)
        if found.prior is not None:
            axes.plot([found.prior], [0.0], "kx")
        axes.set_yticks([])
        axes.set_title(found.name, fontsize=9)
        axes.tick_params(labelsize=8)
        axes.locator_params(axis="x", nbins=4)
    figure.suptitle("estimates with 95 % intervals (grey: not taken), x the value in force")
    figure.savefig(file, dpi=110)
    return True


def draw_steering(record: MotionRecord, vehicle: VehicleParameters, file: Path) -> None:
    """Write a PNG of yaw rate as measured and as the fitted steering explains it.

    Raises ValueError where the record says nothing of the steering.
    """
    fit = fit_steering(record, vehicle)
    used = fit.signals.used
    time_s = record.time_s[used]
    values = fit.fit.values
    measured = fit.signals.yaw_rate_radps[used] - values[Theta.GYRO_BIAS]
    explained = measured - fit.signals.unexplained(values).yaw_rate_radps
    # A stop between two instants would else be drawn as a line.
    jumps = np.flatnonzero(np.diff(used) > 1) + 1
    time_s, measured, explained = (
        np.insert(values, jumps, np.nan) for values in (time_s, measured, explained)
    )
    figure = Figure(figsize=(10.0, 5.0), layout="constrained")
    FigureCanvasAgg(figure)
    upper, lower = figure.subplots(2, 1, sharex=True, height_ratios=[2, 1])
    upper.plot(time_s, measured, color="0.6", label="measured")
    upper.plot(time_s, explained, color=_TAKEN, linewidth=1.0, label="from the steering wheel")
    upper.set_ylabel("yaw rate, rad/s")
    upper.legend()
    lower.plot(time_s, measured - explained, color="0.3", linewidth=0.8)
    lower.set_ylabel("unexplained, rad/s")
    lower.set_xlabel("time, s")
    figure.savefig(file, dpi=110)
