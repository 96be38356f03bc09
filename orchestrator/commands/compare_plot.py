"""A picture of two drives of one road: their ways, and what they did there, place by place."""

from __future__ import annotations

from pathlib import Path

from matplotlib.figure import Figure

from foretwin.sim_worker.analysis.two_drives.differences import UNITS, DriveDifference

_LABELS = {
    "lateral_m": "to the left, m",
    "speed_mps": "speed, m/s",
    "time_per_100m_s": "time for 100 m, s",
    "accel_mps2": "acceleration, m/s²",
}


def write_plot(found: DriveDifference, folder: Path) -> Path:
    """Write compare.png into `folder`: each difference along the first drive's way."""
    figure = Figure(figsize=(10, 9), layout="constrained")
    axes = figure.subplots(len(UNITS), 1, sharex=True)
    for axis, name in zip(axes, UNITS, strict=True):
        spread = found.spreads[name]
        for one in found.stretches:
            axis.plot(one.a_m, one.values[name], linewidth=0.9)
        if spread.places:
            axis.axhspan(spread.quantiles[0], spread.quantiles[-1], color="0.92")
            axis.axhline(spread.quantiles[2], color="0.6", linewidth=0.8)
        axis.set_ylabel(_LABELS[name])
        axis.grid(visible=True, alpha=0.3)
    axes[0].set_title("second drive minus first; grey: 90 % of the places, and the median")
    axes[-1].set_xlabel("along the first drive, m")
    file = folder / "compare.png"
    figure.savefig(file, dpi=110)
    return file
