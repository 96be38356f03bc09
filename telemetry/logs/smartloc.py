"""Reader of smartLoc's texts (TU Chemnitz, also shipped with libRSF): ground truth and odometry.

`point3` lines are ECEF metres (WGS84), `odom3` lines the speed along x in m/s and turn rates in
rad/s about x forward, y left, z up (from wheels and gyroscope of the car); both are seconds from
the log's start, on one clock. No reference point is documented: where the antenna sits on the car
is unknown, so `body_from_antenna_m` is None. There is no accelerometer: the acceleration forwards
is that of the speed since the odometry before, the others are those of a car at rest.

A text is read as it stands, a folder with both kinds of text (`*_GT.txt`, `*_Input.txt`, packed by
gzip or not) as one drive. Pseudoranges are left out.

Checked on Potsdamer Platz (tests/telemetry/motion_proof.py): the yaw rate is the course's change
(correlation 0.99, slope 0.97, 0.05 s late), the speed that of the positions (1.00, 1.01, 0 s).
"""

from __future__ import annotations

import gzip
import itertools
import zlib
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import numpy as np

from foretwin.contracts.arrays import Array
from foretwin.contracts.errors import one_line
from foretwin.contracts.frames import geo_from_ecef
from foretwin.telemetry.logs.columns import Stream, stream_of, table_log
from foretwin.telemetry.logs.log import MOST_TIME_S, Log, LogError
from foretwin.telemetry.logs.units import STANDARD_GRAVITY_MPS2

POINT, ODOMETRY = "point3", "odom3"
_COLUMNS = {POINT: 3, ODOMETRY: 6}
"""Numbers after the time that are read of a line."""
_LINE = "point3 TIME_S X_M Y_M Z_M [9 covariances]"
_NEXT_S = 1.0
"""Odometry this far apart says nothing of the acceleration between."""
_MOST_LINE = 4096
_GZIP_MAGIC = b"\x1f\x8b"


class _Lines(NamedTuple):
    """Rows (N, 1 + numbers) by keyword, and how many lines could not be read."""

    rows: dict[str, Array]
    unreadable: int


def is_smartloc(head: str) -> bool:
    """Tell whether a file that begins with `head` is such a text."""
    return any(line.split()[:1] in ([POINT], [ODOMETRY]) for line in head.splitlines()[:5])


def smartloc_texts(folder: Path) -> list[Path]:
    """Return the texts in a folder that make one drive, by name; none in any other folder."""
    names = (*folder.glob("*_GT.txt*"), *folder.glob("*_Input.txt*"))
    return sorted(path for path in names if path.suffix in (".txt", ".gz") and path.is_file())


def open_smartloc(path: Path) -> Log:
    """Open a text or a folder of them; raises LogError where it has no readable position."""
    texts = smartloc_texts(path) if path.is_dir() else [path]
    found = _read(texts)
    if not len(found.rows[POINT]):
        hint = "; its odometry needs the positions: name the folder" if path.is_file() else ""
        more = hint if len(found.rows[ODOMETRY]) else ""
        raise LogError(f"{path}: no readable line of the form '{_LINE}'{more}")
    places = found.rows[POINT]
    streams = {"gnss": stream_of("gnss", _ns(places), _geo_from_ecef_or_nan(places[:, 1:]))}
    odometry = found.rows[ODOMETRY]
    if len(odometry):
        stamps_ns = _ns(odometry)
        streams["speed"] = stream_of("speed", stamps_ns, odometry[:, 1:2])
        imu = _imu(odometry)
        told = np.isfinite(imu["accel_x"])
        streams["imu"] = Stream(stamps_ns[told], {n: one[told] for n, one in imu.items()})
    return table_log(
        path.name,
        streams,
        stamps_ns=np.sort(np.concatenate([one.stamps_ns for one in streams.values()])),
        time_base="log",
        reference_point="undocumented point of a NovAtel SPAN system",
        unreadable=found.unreadable,
    )


def _read(texts: list[Path]) -> _Lines:
    rows: dict[str, list[list[float]]] = {POINT: [], ODOMETRY: []}
    unreadable = 0
    for path in texts:
        for line in _lines(path):
            words = line.split(maxsplit=8)
            if "\0" in line:  # of a disk that filled up: lines may have gone with it
                unreadable += 1
                continue
            if not words or words[0] not in rows:
                continue
            try:
                row = [float(word) for word in words[1 : 2 + _COLUMNS[words[0]]]]
            except ValueError:
                row = []
            # A text that was cut off ends in a number of which digits may be missing.
            cut = len(words) == len(row) + 1 and not line[-1].isspace()
            # False for a time that is no number.
            if len(row) > _COLUMNS[words[0]] and not cut and abs(row[0]) < MOST_TIME_S:
                rows[words[0]].append(row)
            else:
                unreadable += 1
    shaped = {name: np.array(one).reshape(-1, 1 + _COLUMNS[name]) for name, one in rows.items()}
    return _Lines(shaped, unreadable)


def _lines(path: Path) -> Iterator[str]:
    with path.open("rb") as file:
        packed = file.read(2) == _GZIP_MAGIC
    opening = gzip.open if packed else open
    try:
        with opening(path, "rt", encoding="utf-8", errors="replace") as text:
            # A line that never ends is none: it is cut.
            yield from itertools.takewhile(bool, iter(lambda: text.readline(_MOST_LINE), ""))
    except (EOFError, zlib.error, gzip.BadGzipFile) as error:
        raise LogError(f"{path}: damaged gzip: {one_line(error)}") from None


def _ns(rows: Array) -> np.ndarray[tuple[int], np.dtype[np.int64]]:
    return np.round(rows[:, 0] * 1e9).astype(np.int64)


def _imu(odometry: Array) -> dict[str, Array]:
    """Return the columns of imu: rates as measured, the acceleration of the speed."""
    time_s, speed_mps = odometry[:, 0], odometry[:, 1]
    step_s = np.diff(time_s, prepend=np.nan)
    usable = (step_s > 0.0) & (step_s < _NEXT_S)  # false for NaN
    with np.errstate(over="ignore", invalid="ignore"):  # of numbers that were damaged
        forward = np.diff(speed_mps, prepend=np.nan) / np.where(usable, step_s, np.nan)
    still = np.zeros(len(odometry))
    return {
        "accel_x": forward,
        "accel_y": still,
        "accel_z": still + STANDARD_GRAVITY_MPS2,
        "rate_x": odometry[:, 4],
        "rate_y": odometry[:, 5],
        "rate_z": odometry[:, 6],
    }


def _geo_from_ecef_or_nan(xyz_m: Array) -> Array:
    """Convert (N, 3) ECEF; points below 1 km from the Earth's centre are no positions: NaN."""
    geo = np.full(xyz_m.shape, np.nan)
    near = np.abs(xyz_m) < 1e9  # false for NaN
    good = near.all(axis=1) & (np.linalg.norm(np.where(near, xyz_m, 0.0), axis=1) > 1000.0)
    if good.any():
        geo[good] = geo_from_ecef(xyz_m[good])
    return geo
