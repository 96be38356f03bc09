"""Reader of the smartLoc ground-truth text (TU Chemnitz, also shipped with libRSF).

Declares: ECEF metres (WGS84), seconds from the log's start, and no documented reference point:
where the antenna sits on the car is unknown, so `body_from_antenna_m` is None.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from foretwin.contracts.arrays import Array
from foretwin.contracts.drive import GnssFix, VehicleInfo
from foretwin.contracts.frames import GeoPoint, geo_from_ecef
from foretwin.telemetry.logs.log import UNREADABLE_ROW, Declared, Log, LogError, Sample

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
            if math.isfinite(row[0]):
                rows.append(row)
            else:
                unreadable += 1
    if not rows:
        raise LogError(f"{path}: no readable line of the form '{_COLUMNS}'")
    table = np.array(rows)
    stamps_ns = np.round(table[:, 0] * 1e9).astype(np.int64)
    geo = _geo_from_ecef_or_nan(table[:, 1:])

    def read(skipped: Counter[str]) -> Iterator[Sample]:
        if unreadable:
            skipped[UNREADABLE_ROW] += unreadable
        for stamp_ns, (lat, lon, alt) in zip(stamps_ns.tolist(), geo.tolist(), strict=True):
            yield "gnss", GnssFix(stamp_ns=stamp_ns, position=GeoPoint(lat, lon, alt))

    return Log(
        info=VehicleInfo(
            vehicle_id="car",
            time_base="log",
            start_stamp_ns=int(stamps_ns[0]),
            end_stamp_ns=int(stamps_ns.max()),
            source=path.name,
            reference_point="undocumented point of a NovAtel SPAN system",
            sends=("gnss",),
        ),
        declared=Declared(
            units="m, s",
            frame="ECEF, WGS84",
            time_base="seconds from the start of the log",
            reference_point="undocumented",
        ),
        read=read,
    )


def _geo_from_ecef_or_nan(xyz_m: Array) -> Array:
    """Convert (N, 3) ECEF; points below 1 km from the Earth's centre are no positions: NaN."""
    geo = np.full(xyz_m.shape, np.nan)
    with np.errstate(invalid="ignore"):
        good = np.linalg.norm(xyz_m, axis=1) > 1000.0
    good &= np.isfinite(xyz_m).all(axis=1)
    if good.any():
        geo[good] = geo_from_ecef(xyz_m[good])
    return geo
