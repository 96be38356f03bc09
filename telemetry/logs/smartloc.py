"""Reader of the smartLoc ground-truth text (TU Chemnitz, also shipped with libRSF).

Declares: ECEF metres (WGS84), seconds from the log's start, and no documented reference point:
where the antenna sits on the car is unknown, so `body_from_antenna_m` is None.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from foretwin.contracts.arrays import Array
from foretwin.contracts.frames import geo_from_ecef
from foretwin.telemetry.logs.columns import stream_of, table_log
from foretwin.telemetry.logs.log import MOST_TIME_S, Log, LogError

KEYWORD = "point3"
_COLUMNS = "point3 TIME_S X_M Y_M Z_M [9 covariances]"


def is_smartloc(head: str) -> bool:
    """Tell whether a file that begins with `head` is such a text."""
    return any(line.split()[:1] == [KEYWORD] for line in head.splitlines()[:5])


def open_smartloc(path: Path) -> Log:
    """Open a `point3` text; raises LogError where it has no readable line."""
    unreadable = 0
    rows: list[tuple[float, float, float, float]] = []
    with path.open(encoding="utf-8", errors="replace") as text:
        for line in text:
            words = line.split()
            if not words or words[0] != KEYWORD:
                continue
            try:
                row = (float(words[1]), float(words[2]), float(words[3]), float(words[4]))
            except (ValueError, IndexError):
                unreadable += 1
                continue
            if abs(row[0]) < MOST_TIME_S:  # false for NaN
                rows.append(row)
            else:
                unreadable += 1
    if not rows:
        raise LogError(f"{path}: no readable line of the form '{_COLUMNS}'")
    table = np.array(rows)
    stamps_ns = np.round(table[:, 0] * 1e9).astype(np.int64)
    geo = _geo_from_ecef_or_nan(table[:, 1:])
    return table_log(
        path.name,
        {"gnss": stream_of("gnss", stamps_ns, geo)},
        stamps_ns=stamps_ns,
        time_base="log",
        reference_point="undocumented point of a NovAtel SPAN system",
        unreadable=unreadable,
    )


def _geo_from_ecef_or_nan(xyz_m: Array) -> Array:
    """Convert (N, 3) ECEF; points below 1 km from the Earth's centre are no positions: NaN."""
    geo = np.full(xyz_m.shape, np.nan)
    near = np.abs(xyz_m) < 1e9  # false for NaN
    good = near.all(axis=1) & (np.linalg.norm(np.where(near, xyz_m, 0.0), axis=1) > 1000.0)
    if good.any():
        geo[good] = geo_from_ecef(xyz_m[good])
    return geo
