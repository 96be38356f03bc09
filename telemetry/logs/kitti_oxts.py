"""Reader of KITTI's oxts (Karlsruhe, 2011): a folder or zip of `oxts/data/*.txt`, a row each.

Declares, by `dataformat.txt`: degrees on WGS84 and metres of the OXTS RT3003 itself (where it sits
on the car is not told there, so `body_from_antenna_m` is None), `pos_accuracy` as the standard
deviation, yaw in radians counter-clockwise from east, forward speed in m/s, and specific force in
m/s² and rates in rad/s about x forward, y left, z up. `timestamps.txt` names no zone: times count
from the first (time base `log`).

Checked on the 2,762 rows of 2011_09_30_drive_0018 (tests/telemetry/motion_proof.py): speed 1.00 of
the positions', yaw rate 0.99 of the course's change, heading 0.1° off the course.
"""

from __future__ import annotations

import errno
import zipfile
import zlib
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path, PurePosixPath
from typing import NamedTuple

import numpy as np

from foretwin.contracts.errors import one_line
from foretwin.telemetry.logs.columns import stream_of, table_log
from foretwin.telemetry.logs.gpx import stamp_ns_from_iso
from foretwin.telemetry.logs.log import UNREADABLE_ROW, Log, LogError

NO_TIME_FOR_ROW = "row without its time"
NO_ROW_FOR_TIME = "time without its row"
_NUMBERS = 30
_MOST_ROW_BYTES = 4096
_MOST_TIMES_BYTES = 1 << 26
"""A day at 10 Hz is 26 MB."""
_DAMAGED = (zipfile.BadZipFile, zlib.error, EOFError, NotImplementedError, RuntimeError)
"""What zipfile raises over bytes that are damaged, packed otherwise or encrypted."""
_COLUMNS = {
    "gnss": (0, 1, 2, 23),
    "heading": (5, 22),
    "speed": (8,),
    "imu": (11, 12, 13, 17, 18, 19),
}
"""lat, lon, alt, pos_accuracy; yaw, wu; vf; ax, ay, az, wx, wy, wz."""


class _Files(NamedTuple):
    """The files of a drive: names in the folder `data`, and how one of them is read."""

    rows: list[str]
    times: Callable[[], bytes]
    row: Callable[[str], bytes]


def is_kitti_oxts(path: Path) -> bool:
    """Tell whether a folder or a zip holds a drive's oxts."""
    if path.is_dir():
        return _folder(path) is not None
    try:
        with zipfile.ZipFile(path) as packed:
            return _member_folder(packed) is not None
    except (*_DAMAGED, OSError, ValueError):
        return False


def open_kitti_oxts(path: Path) -> Log:
    """Open a drive's folder, its `oxts` folder, or a zip of one of them.

    Raises LogError where there are no times or no readable row; rows without a time are left out.
    """
    refused: Counter[str] = Counter()
    stamps: list[int] = []
    rows: list[list[float]] = []
    with _files(path) as files:
        times = _times(path, files.times())
        if len(files.rows) > len(times):
            refused[NO_TIME_FOR_ROW] = len(files.rows) - len(times)
        there = set(files.rows)
        for number, stamp_ns in enumerate(times):
            name = f"{number:010d}.txt"
            if stamp_ns is None or name not in there:
                refused[UNREADABLE_ROW if stamp_ns is None else NO_ROW_FOR_TIME] += 1
                continue
            row = _row(files.row(name))
            if row is None:
                refused[UNREADABLE_ROW] += 1
                continue
            stamps.append(stamp_ns)
            rows.append(row)
    if not rows:
        raise LogError(f"{path}: no readable row of {_NUMBERS} numbers in oxts/data")
    table = np.array(rows)
    stamps_ns = np.array(stamps, dtype=np.int64) - stamps[0]
    return table_log(
        path.name,
        {
            channel: stream_of(channel, stamps_ns, table[:, columns])
            for channel, columns in _COLUMNS.items()
        },
        stamps_ns=stamps_ns,
        time_base="log",
        reference_point="OXTS RT3003",
        refused=refused,
    )


def _folder(path: Path) -> Path | None:
    """Return the folder `oxts` of a drive."""
    for folder in (path / "oxts", path):
        if (folder / "data").is_dir() and (folder / "timestamps.txt").is_file():
            first = next((folder / "data").glob("*.txt"), None)
            if folder.name == "oxts" or (first is not None and _row(_head(first)) is not None):
                return folder
    return None


def _member_folder(packed: zipfile.ZipFile) -> str | None:
    """Return the folder `oxts` within a zip, the first where there are several."""
    names = (PurePosixPath(name) for name in packed.namelist())
    found = sorted(
        str(name.parent) for name in names
        if name.name == "timestamps.txt" and name.parent.name == "oxts"
    )  # fmt: skip
    return found[0] if found else None


@contextmanager
def _files(path: Path) -> Iterator[_Files]:
    if path.is_dir():
        folder = _folder(path) or path
        yield _Files(
            [one.name for one in (folder / "data").glob("*.txt")],
            lambda: _head(folder / "timestamps.txt", _MOST_TIMES_BYTES),
            lambda name: _head(folder / "data" / name),
        )
        return
    try:
        with zipfile.ZipFile(path) as packed:
            inside = _member_folder(packed) or ""

            def read(name: str, most: int = _MOST_ROW_BYTES) -> bytes:
                with packed.open(f"{inside}/{name}") as file:
                    return file.read(most)

            data = [PurePosixPath(name) for name in packed.namelist()]
            yield _Files(
                [one.name for one in data if str(one.parent) == f"{inside}/data"],
                lambda: read("timestamps.txt", _MOST_TIMES_BYTES),
                lambda name: read(f"data/{name}"),
            )
    except (*_DAMAGED, OSError) as error:
        if isinstance(error, OSError) and error.errno != errno.EINVAL:
            raise
        # EINVAL: a place that the zip says it has and has not.
        raise LogError(f"{path}: damaged zip: {one_line(error)}") from None


def _head(path: Path, most: int = _MOST_ROW_BYTES) -> bytes:
    with path.open("rb") as file:
        return file.read(most)


def _times(path: Path, data: bytes) -> list[int | None]:
    """Return the stamp of each row in ns since 1970 as if of UTC, None where it is unreadable."""
    times = []
    for line in data.decode("utf-8", "replace").splitlines():
        # Nine digits after the point: more than a date of Python's holds.
        whole, _, fraction = line.strip().partition(".")
        seconds_ns = stamp_ns_from_iso(whole)
        known = seconds_ns is not None and fraction[:9].isdecimal()
        times.append(seconds_ns + int(fraction[:9].ljust(9, "0")) if known and seconds_ns else None)
    if not any(time is not None for time in times):
        raise LogError(f"{path}: no readable time in oxts/timestamps.txt (2011-09-26 13:02:25.96)")
    return times


def _row(data: bytes) -> list[float] | None:
    words = data.split()
    if len(words) < _NUMBERS:
        return None
    try:
        return [float(word) for word in words[:_NUMBERS]]
    except ValueError:
        return None
