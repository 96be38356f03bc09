"""Plots of the reality gap: errors over the drive, and by horizon and manoeuvre."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from foretwin.contracts.gap import GapSample, Verdict
from foretwin.sim_worker.analysis.gap.errors import gap_table

_PANELS = (
    ("along_m", "along, m", 1.0),
    ("across_m", "across, m", 1.0),
    ("yaw_rad", "heading, °", 57.29578),
    ("speed_mps", "speed, m/s", 1.0),
)


def write_plots(
    samples: Sequence[GapSample], verdicts: Sequence[Verdict], folder: Path, *, start_ns: int
) -> list[Path]:
    """Write gap_over_time.png and gap_by_horizon.png into `folder`; returns what was written.

    Times are those since `start_ns`; a verdict is a line where it fell and a band since when.
    """
    over_time = Figure(figsize=(10, 9), layout="constrained")
    horizons = sorted({sample.horizon_s for sample in samples})
    axes = over_time.subplots(len(_PANELS), 1, sharex=True)
    for axis, (name, label, scale) in zip(axes, _PANELS, strict=True):
        for horizon in horizons:
            rows = [one for one in samples if one.horizon_s == horizon]
            time_s = [(one.stamp_ns - start_ns) * 1e-9 for one in rows]
            values = [scale * getattr(one, name) for one in rows]
            axis.plot(time_s, values, label=f"{horizon:g} s", linewidth=1.0)
        for verdict in verdicts:
            at_s = (verdict.stamp_ns - start_ns) * 1e-9
            axis.axvspan((verdict.since_stamp_ns - start_ns) * 1e-9, at_s, color="0.85")
            axis.axvline(at_s, color="0.4", linewidth=0.8)
        axis.set_ylabel(label)
        axis.grid(visible=True, alpha=0.3)
    for number, verdict in enumerate(verdicts):
        # In turn one below the other: verdicts may follow each other closely.
        axes[0].annotate(
            f"{verdict.culprit}: {verdict.cause}",
            ((verdict.stamp_ns - start_ns) * 1e-9, 1.0),
            xycoords=("data", "axes fraction"),
            xytext=(3, -10 - 11 * (number % 4)),
            textcoords="offset points",
            fontsize=8,
        )
    lines, labels = axes[0].get_legend_handles_labels()
    over_time.legend(lines, labels, title="after", ncols=len(horizons), loc="outside lower center")
    axes[0].set_title("model minus reality")
    axes[-1].set_xlabel("drive time, s")
    by_horizon = Figure(figsize=(10, 4), layout="constrained")
    table = gap_table(samples)
    pair = by_horizon.subplots(1, 2)
    for axis, (name, label, scale) in zip(pair, _PANELS[:2], strict=True):
        for manoeuvre in dict.fromkeys(row.manoeuvre for row in table):
            rows_of = [row for row in table if row.manoeuvre == manoeuvre]
            x = np.array([row.horizon_s for row in rows_of])
            y = np.array([scale * row.rms[name] for row in rows_of])
            axis.plot(x, y, marker="o", label=manoeuvre)
        axis.set_xlabel("horizon, s")
        axis.set_ylabel(f"RMS {label}")
        axis.grid(visible=True, alpha=0.3)
    pair[0].legend()
    written = [folder / "gap_over_time.png", folder / "gap_by_horizon.png"]
    for figure, file in zip((over_time, by_horizon), written, strict=True):
        figure.savefig(file, dpi=110)
    return written
