"""Real drives as tables that nobody declared: other names, units, signs, frames, clocks and rows.

What each seed makes of a drive is drawn; the drive's own samples are the truth.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pyproj

from foretwin.contracts.arrays import Array
from foretwin.telemetry.logs import Log
from foretwin.telemetry.logs.columns import CHANNEL_COLUMNS, Stream
from tests.telemetry.logs.declare.written_table import Written, write_table

GERMAN = {
    "time": "Zeit", "latitude": "Breite", "longitude": "Länge", "altitude": "Höhe",
    "easting": "Rechtswert", "northing": "Hochwert", "x": "X", "y": "Y", "z": "Z",
    "forward": "Geschw", "east": "v_ost", "north": "v_nord", "yaw": "Kurs", "rate_z": "Gierrate",
    "accel_x": "Laengsbeschl", "accel_y": "Querbeschl", "accel_z": "Hochbeschl",
    "wheel": "Lenkradwinkel", "tire": "Radwinkel",
}  # fmt: skip
SHORT = {
    "time": "t", "latitude": "lat", "longitude": "lon", "altitude": "h", "easting": "E",
    "northing": "N", "x": "x", "y": "y", "z": "z", "forward": "v", "east": "ve", "north": "vn",
    "yaw": "psi", "rate_z": "r", "accel_x": "ax", "accel_y": "ay", "accel_z": "az",
    "wheel": "swa", "tire": "delta",
}  # fmt: skip
SPEEDS = {"m/s": 1.0, "km/h": 3.6, "mph": 1 / 0.44704, "kn": 3600 / 1852, "cm/s": 100.0}
DEG = 180.0 / math.pi
_G = 9.80665


Drive = dict[str, Stream]


class Table(NamedTuple):
    """A table, the drive in it as it should be read, and how it was made."""

    path: Path
    truth: Drive
    late_s: dict[str, float]
    answers: dict[str, str]
    made: str


def drive_of(log: Log) -> Drive:
    """Return the samples of a log as columns."""
    rows: dict[str, list[tuple[float | None, ...]]] = {}
    stamps: dict[str, list[int]] = {}
    for channel, message in log.samples():
        if channel in CHANNEL_COLUMNS:
            rows.setdefault(channel, []).append(CHANNEL_COLUMNS[channel].numbers(message))
            stamps.setdefault(channel, []).append(message.stamp_ns)  # type: ignore[attr-defined]
    found = {}
    for channel, numbers in rows.items():
        array = np.array(numbers, dtype=np.float64)
        fields = {
            name: column
            for name, column in zip(CHANNEL_COLUMNS[channel].fields, array.T, strict=True)
            if np.isfinite(column).any()
        }
        found[channel] = Stream(np.array(stamps[channel], dtype=np.int64), fields)
    return found


def with_sensors(drive: Drive, *, seed: int) -> Drive:
    """Return positions with the sensors that a car driving through them would have had."""
    from scipy.signal import savgol_filter

    from foretwin.contracts.frames import GeoPoint, LocalFrame, local_from_geo

    random = np.random.default_rng(seed)
    gnss = drive["gnss"]
    lat, lon = gnss.columns["latitude"], gnss.columns["longitude"]
    xy = local_from_geo(LocalFrame(GeoPoint(float(lat[0]), float(lon[0]))), lat, lon)
    time_s = (gnss.stamps_ns - gnss.stamps_ns[0]) * 1e-9
    ticks = np.arange(0.0, time_s[-1], 0.02)
    x, y = (np.interp(ticks, time_s, column) for column in xy.T)
    (vx, ax), (vy, ay) = (
        [savgol_filter(one, 75, 3, deriv=d, delta=0.02) for d in (1, 2)] for one in (x, y)
    )
    speed = np.hypot(vx, vy)
    rolls = np.maximum(speed, 0.5)
    turn = np.where(speed > 0.5, (vx * ay - vy * ax) / rolls**2, 0.0)
    count = len(ticks)
    noise = random.normal(size=(6, count))
    stamps = gnss.stamps_ns[0] + np.round(ticks * 1e9).astype(np.int64)
    ahead = np.where(speed > 0.5, (vx * ax + vy * ay) / rolls, 0.0)
    bend = np.clip(turn / rolls, -0.2, 0.2)
    few = slice(None, None, 2)
    return drive | {
        "speed": Stream(stamps[::5], {"forward": np.maximum(speed + 0.03 * noise[0], 0.0)[::5]}),
        "imu": Stream(
            stamps,
            {
                "accel_x": ahead + 0.2 + 0.15 * noise[1],
                "accel_y": speed * turn - 0.1 + 0.15 * noise[2],
                "accel_z": 9.81 + 0.1 * noise[3],
                "rate_z": turn + 0.004 + 0.004 * noise[4],
            },
        ),
        "steering": Stream(
            stamps[few], {"wheel": (15.2 * np.arctan(2.8 * bend) + 0.03 + 0.005 * noise[5])[few]}
        ),
    }  # fmt: skip


def disguise(
    drive: Drive, folder: Path, *, seed: int, late: bool = True, sensors: bool = True
) -> Table:
    """Write a drive as some table; without `late` nothing of it is late, the rest is the same."""
    random = np.random.default_rng(seed)

    def pick(*choices: Any) -> Any:
        return choices[int(random.integers(len(choices)))]

    kept: Drive = {
        name: stream
        for name, stream in drive.items()
        if name == "gnss" or (sensors and random.random() < 0.85)
    }
    first_ns = min(int(stream.stamps_ns[0]) for stream in drive.values())
    start_ns = pick(0, 1_712_345_678_000_000_000, 4_321_000_000_000)
    late_s = {
        name: float(pick(0.0, 0.0, round(random.uniform(0.15, 0.5), 2), -0.2))
        for name in ("speed", "steering")
        if name in kept
    }
    if not late:
        late_s = dict.fromkeys(late_s, 0.0)
    most_ns = round(0.6e9)
    kept = {
        name: Stream(
            stream.stamps_ns - first_ns + start_ns + most_ns + round(late_s.get(name, 0.0) * 1e9),
            stream.columns,
        )
        for name, stream in kept.items()
    }
    columns, said, answers = _columns(kept, pick, random)
    unit = pick("s", "s", "ms", "us", "ns", "iso8601" if start_ns > 10**18 else "ms")
    names = pick(GERMAN, SHORT, None, None)
    layout = pick("blank", "held", "held with counters")
    path = folder / f"drive_{seed}.{pick('csv', 'csv', 'tsv', 'parquet')}"
    _add_strangers(columns, kept, pick, random)
    order = random.permutation(len(columns))
    columns = [columns[place] for place in order]
    write_table(path, columns, unit=unit, names=names, layout=layout, pick=pick, answers=answers)
    made = f"{path.name} {said} time {unit} from {start_ns} {layout} late {late_s}"
    return Table(path, kept, late_s, answers, made)


def _columns(
    kept: Drive, pick: Callable[..., Any], random: np.random.Generator
) -> tuple[list[Written], str, dict[str, str]]:
    columns: list[Written] = []
    said = []
    answers: dict[str, str] = {}

    def add(channel: str, field: str, values: Array, decimals: int) -> None:
        columns.append(Written(kept[channel].stamps_ns, values, decimals, field))

    gnss = kept["gnss"].columns
    lat, lon = gnss["latitude"], gnss["longitude"]
    frame = pick("deg", "deg", "rad", "1e-7 deg", "ecef", "utm")
    said.append(frame)
    if frame == "ecef":
        to_ecef = pyproj.Transformer.from_crs("EPSG:4979", "EPSG:4978", always_xy=True)
        altitude = gnss.get("altitude", np.zeros(len(lat)))
        for field, values in zip("xyz", to_ecef.transform(lon, lat, altitude), strict=True):
            add("gnss", field, np.asarray(values), 4)
    elif frame == "utm":
        zone = int((float(lon[0]) + 180.0) // 6.0) + 1
        answers["epsg"] = str(32600 + zone)
        to_grid = pyproj.Transformer.from_crs(4326, 32600 + zone, always_xy=True)
        for field, values in zip(("easting", "northing"), to_grid.transform(lon, lat), strict=True):
            add("gnss", field, np.asarray(values), 4)
    else:
        factor = {"deg": 1.0, "rad": 1.0 / DEG, "1e-7 deg": 1e7}[frame]
        decimals = {"deg": 9, "rad": 11, "1e-7 deg": 1}[frame]
        add("gnss", "latitude", lat * factor, decimals)
        add("gnss", "longitude", lon * factor, decimals)
    if "altitude" in gnss and frame != "ecef" and random.random() < 0.5:
        add("gnss", "altitude", gnss["altitude"], 3)
    if "speed" in kept:
        unit = pick(*SPEEDS)
        said.append(unit)
        add("speed", "forward", kept["speed"].columns["forward"] * SPEEDS[unit], 4)
    if "heading" in kept:
        yaw = kept["heading"].columns["yaw"]
        turned, unit = pick("north", "east"), pick("deg", "rad")
        mount = pick(0.0, 0.0, math.radians(round(random.uniform(-170.0, 170.0), 1)))
        angle = (0.5 * math.pi - yaw if turned == "north" else yaw) + mount
        angle = np.mod(angle, math.tau) if pick(True, False) else np.angle(np.exp(1j * angle))
        said.append(f"heading {unit} from {turned} {mount:+.2f}")
        add("heading", "yaw", angle * (DEG if unit == "deg" else 1.0), 5)
        rate = kept["heading"].columns.get("yaw_rate")
        if rate is not None and "imu" not in kept:
            sign = pick(1.0, -1.0)
            unit = pick("deg/s", "rad/s")
            said.append(f"rate {sign:+.0f} {unit}")
            add("heading", "rate_z", sign * rate * (DEG if unit == "deg/s" else 1.0), 6)
    if "imu" in kept:
        imu = kept["imu"].columns
        unit, rate_unit = pick("m/s2", "g"), pick("rad/s", "deg/s")
        said.append(f"imu {unit} {rate_unit}")
        for field in ("accel_x", "accel_y", "accel_z"):
            sign = pick(1.0, -1.0)
            said.append(f"{sign:+.0f}")
            add("imu", field, sign * imu[field] / (_G if unit == "g" else 1.0), 5)
        sign = pick(1.0, -1.0)
        said.append(f"{sign:+.0f}")
        add("imu", "rate_z", sign * imu["rate_z"] * (DEG if rate_unit == "deg/s" else 1.0), 6)
    if "steering" in kept:
        for field, values in kept["steering"].columns.items():
            sign, unit = pick(1.0, -1.0), pick("deg", "rad")
            said.append(f"{field} {sign:+.0f} {unit}")
            add("steering", field, sign * values * (DEG if unit == "deg" else 1.0), 5)
    return columns, " ".join(said), answers


def _add_strangers(
    columns: list[Written], kept: Drive, pick: Callable[..., Any], random: np.random.Generator
) -> None:
    """Add columns that are nothing of ours and do go with the drive, or nearly."""
    source = kept[pick(*kept)]
    stamps, count = source.stamps_ns, len(source.stamps_ns)
    drift = np.cumsum(random.normal(0.0, 0.02, count))
    strangers: list[tuple[str, Array, int]] = [
        ("temp", 20.0 + drift, 2), ("status", random.integers(0, 4, count).astype(float), 0),
        ("sats", np.round(9.0 + drift), 0), ("volt", 12.6 + random.normal(0, 0.05, count), 2),
        ("zero", np.zeros(count), 0),
    ]  # fmt: skip
    if "speed" in kept:
        speed = kept["speed"].columns["forward"]
        gear = np.clip(np.floor(speed / 6.0), 0, 4)
        rpm = np.maximum(
            800.0, speed * np.array([400.0, 220.0, 150.0, 115.0, 90.0])[gear.astype(int)]
        )
        way = np.concatenate(
            [[0.0], np.cumsum(speed[1:] * np.diff(kept["speed"].stamps_ns) * 1e-9)]
        )
        stamps_v = kept["speed"].stamps_ns
        columns += [Written(stamps_v, rpm, 0, "rpm"), Written(stamps_v, 5e4 + way / 1000, 3, "odo")]
    columns += [
        Written(stamps, values, decimals, field)
        for field, values, decimals in strangers
        if random.random() < 0.6
    ]
