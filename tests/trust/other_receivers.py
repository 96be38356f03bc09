"""Other receivers of the same drives: what was recorded beside the reference, as logs.

Pseudoranges of smartLoc, the u-blox receiver of comma2k19, cars at Mcity, Dresden's
logger by its receiver's clock, and the positions of a log alone.
"""

from __future__ import annotations

import csv
import gzip
import json
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import Any

import msgspec
import numpy as np

from foretwin.contracts.arrays import Array
from foretwin.contracts.drive import GnssFix, VehicleInfo
from foretwin.contracts.frames import GeoPoint, geo_from_ecef
from foretwin.telemetry.logs import Log
from foretwin.telemetry.logs.log import Sample

_ROUNDS = 8
_EARTH_RADPM = 7.2921151467e-5 / 299_792_458.0
"""The Earth turns while a signal is under way (IS-GPS-200, 20.3.3.4.3)."""


def positions_alone(log: Callable[[], Log]) -> Log:
    """Return a log with nothing but its positions."""
    opened = log()
    return _log(opened.info, [s for s in opened.samples() if s[0] == "gnss"])


def once_a_second(log: Callable[[], Log], *, beside: tuple[str, ...] = ()) -> Log:
    """Return a log with one position a second, as most receivers send, and channels `beside` it."""
    opened, kept, due_ns = log(), list[Sample](), 0
    for sample in opened.samples():
        if sample[0] == "gnss" and sample[1].stamp_ns >= due_ns:
            due_ns = sample[1].stamp_ns + 990_000_000
            kept.append(sample)
        elif sample[0] in beside:
            kept.append(sample)
    return _log(opened.info, kept)


def with_pseudoranges(odometry: Callable[[], Log], measured: Path) -> Log:
    """Return fixes computed from smartLoc's pseudoranges, epoch by epoch, in place of a log's.

    Least squares for the place and a clock for each satellite system; the standard deviation
    stated is the formal one, which knows nothing of reflected signals.
    """
    epochs: dict[float, list[list[float]]] = {}
    for row in _rows(measured, "pseudorange3"):
        epochs.setdefault(row[0], []).append(row)
    fixes: list[Sample] = []
    for time_s, rows in epochs.items():
        fix = _single_point(np.array(rows), round(time_s * 1e9))
        if fix is not None:
            fixes.append(("gnss", fix))
    opened = odometry()
    return _log(opened.info, [*fixes, *(s for s in opened.samples() if s[0] != "gnss")])


def with_ublox(pose: Callable[[], Log], segment: Path) -> Log:
    """Return a comma2k19 segment with its u-blox receiver's positions in place of the pose."""
    folder = segment / "processed_log" / "GNSS" / "live_gnss_ublox"
    times, values = np.load(folder / "t"), np.load(folder / "value")
    fixes: list[Sample] = [
        (
            "gnss",
            GnssFix(
                stamp_ns=round(time_s * 1e9),
                position=GeoPoint(float(row[0]), float(row[1]), float(row[4])),
            ),
        )
        for time_s, row in zip(times.tolist(), values, strict=True)
    ]
    opened = pose()
    kept = [s for s in opened.samples() if s[0] in ("imu", "speed", "steering")]
    return _log(opened.info, [*fixes, *kept])


def by_receivers_clock(log: Callable[[], Log], path: Path) -> Log:
    """Return Dresden's log as its receiver stamped it: `time` is hhmmss and milliseconds, in UTC.

    The declared clock is that of the computer that wrote the rows, which stood still and hurried
    by up to 4.5 s against the receiver's. Its rows are even between two times; coordinates come
    some rows after the time that they belong to, so that the declared log has those before.
    """
    written, epochs = list[float](), list[float]()
    with path.open(encoding="utf-8") as text:
        for row in csv.DictReader(text):
            clock = int(row["time"])
            minutes_s = 3600.0 * (clock // 10_000_000) + 60.0 * (clock // 100_000 % 100)
            written.append(float(row["millis"]) * 1e6)
            epochs.append(minutes_s + clock % 100_000 * 1e-3)
    first = [k for k, time_s in enumerate(epochs) if k == 0 or time_s != epochs[k - 1]]
    even = np.interp(np.arange(len(epochs)), first, [epochs[k] for k in first])
    opened, start_ns = log(), round(written[0])
    samples: list[Sample] = []
    for channel, message in opened.samples():
        row_at = int(np.argmin(np.abs(np.array(written) - message.stamp_ns)))
        epoch = int(np.searchsorted(first, row_at, side="right")) - 1
        if channel == "gnss" and epoch == 0:
            continue
        time_s = epochs[first[epoch - 1]] if channel == "gnss" else even[row_at]
        stamp_ns = start_ns + round((time_s - epochs[0]) * 1e9)
        samples.append((channel, msgspec.structs.replace(message, stamp_ns=stamp_ns)))
    return _log(opened.info, samples)


def mcity_car(path: Path, *, car: int = 0) -> Log:
    """Return the positions of one car of a trial at Mcity."""
    fixes: list[Sample] = []
    for instant in json.loads(path.read_text(encoding="utf-8")):
        for one in instant["objs"]:
            if one["id"] == car:
                place = GeoPoint(one["lat"], one["lon"])
                stamp_ns = round(instant["timestamp"] * 1e9)
                fixes.append(("gnss", GnssFix(stamp_ns=stamp_ns, position=place)))
    first = fixes[0][1].stamp_ns  # type: ignore[attr-defined]
    info = VehicleInfo(vehicle_id="car", time_base="utc", start_stamp_ns=first, sends=("gnss",))
    return _log(info, fixes)


def _log(info: VehicleInfo, samples: Iterable[Sample]) -> Log:
    ordered = sorted(samples, key=_stamp_ns)
    sends = tuple(sorted({channel for channel, _ in ordered}))
    return Log(info=msgspec.structs.replace(info, sends=sends), read=lambda _skipped: iter(ordered))


def _stamp_ns(sample: Sample) -> Any:
    return sample[1].stamp_ns  # type: ignore[attr-defined]


def _rows(path: Path, keyword: str) -> Iterator[list[float]]:
    with gzip.open(path, "rt", encoding="utf-8") as text:
        for line in text:
            words = line.split()
            if words[:1] == [keyword]:
                yield [float(word) for word in words[1:]]


def _single_point(rows: Array, stamp_ns: int) -> GnssFix | None:
    ranges, variances, satellites, systems = rows[:, 1], rows[:, 2], rows[:, 3:6], rows[:, 7]
    kinds = np.unique(systems)
    if len(rows) < 3 + len(kinds):
        return None
    clocks = (systems[:, None] == kinds).astype(np.float64)
    place = np.zeros(3)
    for _ in range(_ROUNDS):
        away = place - satellites
        turned_m = _EARTH_RADPM * (satellites[:, 0] * place[1] - satellites[:, 1] * place[0])
        distance = np.linalg.norm(away, axis=1) + turned_m
        design = np.hstack([away / distance[:, None], clocks]) / np.sqrt(variances)[:, None]
        step, *_, rank, _ = np.linalg.lstsq(
            design, (ranges - distance) / np.sqrt(variances), rcond=None
        )
        if rank < design.shape[1]:
            return None
        place = place + step[:3]
    lat_deg, lon_deg, alt_m = geo_from_ecef(place).tolist()
    spread = np.linalg.inv(design.T @ design)[:3, :3]
    up = place / np.linalg.norm(place)
    std_m = float(np.sqrt((np.trace(spread) - up @ spread @ up) / 2.0))
    return GnssFix(stamp_ns=stamp_ns, position=GeoPoint(lat_deg, lon_deg, alt_m), std_m=std_m)
