"""Reader of logs of Google's GnssLogger (Android): its `Fix` rows, and the IMU's where declared.

Columns go by the names in the log's own header (`# Fix,...`), which changed over the years.
Declares: degrees on WGS84, metres above the ellipsoid, m/s, reference point the phone (its place in
the car is not told). Accuracy is a radius of 68 % (android.location.Location): over 1.51 it is one
standard deviation on each axis. Yaw is the bearing, in degrees clockwise from true north, above
MIN_COURSE_MPS. Of the providers GPS is taken, else the fused one (FLP); the network's never.

Times are UTC. Fixes have it to the millisecond; the IMU counts from boot (`elapsedRealtimeNanos`),
and so do fixes of newer logs: the first that tells both sets one clock upon the other.

A phone lies in a car as it may: its gyroscope and accelerometer are read where `NAME.toml` beside
the log declares how, by the phone's axes (x to the right of the screen, y up on it, z out of it):

```toml
forward = "y"                          # of the phone's axes, or "-y" and so on
up = "z"
```
"""

from __future__ import annotations

import math
import re
from array import array
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import Literal, NamedTuple

import msgspec
import numpy as np

from foretwin.contracts.arrays import Array, Stamps
from foretwin.contracts.drive import Vector3
from foretwin.telemetry.logs.columns import Stream, stream_of, table_log
from foretwin.telemetry.logs.gpx import representable_ns
from foretwin.telemetry.logs.log import LAST_LINE_OPEN, UNREADABLE_ROW, Log, LogError
from foretwin.telemetry.logs.map_origin import declaration_beside
from foretwin.telemetry.logs.nmea import MIN_COURSE_MPS
from foretwin.telemetry.logs.nmea_sentences import yaw_rad_of

ACCURACY_PER_STD = 1.5096
"""Radius that holds 68 % of a round normal distribution: the root of -2 ln 0.32."""
MOUNTING_UNKNOWN = "imu of a phone whose mounting is not declared"
_FIX = re.compile(r"^\s*#\s*(Fix|Raw|UncalAccel|UncalGyro|Accel|Gyro)\s*,", re.MULTILINE)
_NAMES = {
    "lat": ("LatitudeDegrees", "Latitude"),
    "lon": ("LongitudeDegrees", "Longitude"),
    "alt": ("AltitudeMeters", "Altitude"),
    "speed": ("SpeedMps", "Speed"),
    "accuracy": ("AccuracyMeters", "Accuracy"),
    "bearing": ("BearingDegrees",),
    "unix_ms": ("UnixTimeMillis", "(UTC)TimeInMs"),
    "boot_ns": ("elapsedRealtimeNanos",),
}
"""Columns of Fix, by the names they have had."""
_NEEDED = ("lat", "lon", "unix_ms")
_PROVIDERS = (("gps",), ("flp", "fused"))
_SENSORS = ("Gyro", "Accel", "UncalGyro", "UncalAccel")
_MOST_LINE = 4096
_FRESH_NS = 100_000_000
"""An acceleration older than this is none of the gyroscope's instant."""

Axis = Literal["x", "-x", "y", "-y", "z", "-z"]


class PhoneMounting(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Which of the phone's axes look forwards and up in the car, and where the phone is in it."""

    forward: Axis | None = None
    up: Axis | None = None
    body_from_antenna_m: Vector3 | None = None

    def body_from_phone(self) -> Array | None:
        """Return the matrix (3, 3) from the phone's axes into forward, left, up; None if unsaid."""
        if self.forward is None or self.up is None:
            return None
        forward, up = _unit(self.forward), _unit(self.up)
        return np.stack([forward, np.cross(up, forward), up])


class _Fix(NamedTuple):
    """A fix as it was logged; NaN where a cell is empty."""

    stamp_ns: int
    boot_ns: int | None
    place: tuple[float, float, float]
    std_m: float
    speed_mps: float
    bearing_deg: float


class _Sensor(NamedTuple):
    """Rows of one sensor: UTC by the phone in ms, ns since boot, and x, y, z."""

    unix_ms: array[float]
    boot_ns: array[int]
    xyz: array[float]


def is_gnss_logger(head: str) -> bool:
    """Tell whether a file begins as GnssLogger's do."""
    return _FIX.search(head) is not None


def open_gnss_logger(path: Path, *, declaration: Path | None = None) -> Log:
    """Open a log; `declaration`, else `NAME.toml` beside it, is a PhoneMounting.

    Raises LogError where there is no Fix of GPS or of the fused provider.
    """
    mounting = declaration_beside(path, declaration, PhoneMounting) or PhoneMounting()
    turn = mounting.body_from_phone()
    if turn is not None and abs(abs(np.linalg.det(turn)) - 1.0) > 1e-9:
        raise LogError(f"{path}: forward {mounting.forward!r} and up {mounting.up!r} are one axis")
    fixes: dict[str, list[_Fix]] = {}
    sensors: dict[str, _Sensor] = {}
    refused = _read(path, fixes, sensors)
    chosen = next(
        (fixes[one] for names in _PROVIDERS for one in names if one in fixes), list[_Fix]()
    )
    if not chosen:
        others = f"; it has those of {', '.join(sorted(fixes))}" if fixes else ""
        raise LogError(f"{path}: no Fix row of the provider GPS or FLP{others}")
    streams = _of_fixes(chosen)
    imu = _imu(sensors, turn, _utc_of_boot_ns(chosen))
    if imu is not None:
        streams["imu"] = imu
    elif sensors:
        refused[MOUNTING_UNKNOWN] += sum(len(one.boot_ns) for one in sensors.values())
    return table_log(
        path.name,
        streams,
        stamps_ns=np.sort(np.concatenate([one.stamps_ns for one in streams.values()])),
        time_base="utc",
        reference_point="phone",
        body_from_antenna_m=mounting.body_from_antenna_m,
        refused=refused,
    )


def _read(path: Path, fixes: dict[str, list[_Fix]], sensors: dict[str, _Sensor]) -> Counter[str]:
    """Fill fixes by provider, in small letters, and sensors by row; return what was refused."""
    refused: Counter[str] = Counter()
    places: dict[str, int] = {}
    for line in _lines(path):
        kind, _, rest = line.partition(",")
        if "\0" in line:  # of a disk that filled up: lines may have gone with it
            refused[UNREADABLE_ROW] += 1
            continue
        if kind.startswith("#"):
            if kind.lstrip("# ") == "Fix":
                places = _places(rest.strip().split(","))
            continue
        if not line.endswith("\n") and len(line) < _MOST_LINE:
            # Of a satellite nothing is lost, but what would have come after it is.
            refused[LAST_LINE_OPEN] += 1
            continue
        try:
            if kind == "Fix":
                cells = rest.strip().split(",")
                fixes.setdefault(cells[0].strip().lower(), []).append(_fix(cells, places))
            elif kind in _SENSORS:
                _add(sensors, kind, rest.split(","))
        except (ValueError, IndexError, OverflowError, KeyError):
            refused[UNREADABLE_ROW] += 1
    return refused


def _lines(path: Path) -> Iterator[str]:
    with path.open(encoding="utf-8-sig", errors="replace") as text:
        # A line that never ends is none: it is cut.
        while line := text.readline(_MOST_LINE):
            yield line


def _places(header: list[str]) -> dict[str, int]:
    names = [name.strip() for name in header]
    return {
        field: names.index(name)
        for field, known in _NAMES.items()
        for name in known
        if name in names
    }


def _fix(cells: list[str], places: dict[str, int]) -> _Fix:
    said = {
        field: cells[place].strip() if place < len(cells) else "" for field, place in places.items()
    }
    if not all(said.get(field) for field in _NEEDED):
        raise ValueError("a fix without place or time")
    unix_ns = representable_ns(int(said["unix_ms"]) * 1_000_000)
    if unix_ns is None:
        raise ValueError("a time out of reach")
    number = {field: float(text) if text else math.nan for field, text in said.items()}
    altitude_m = number.get("alt", math.nan)
    return _Fix(
        unix_ns,
        int(said["boot_ns"]) if said.get("boot_ns") else None,
        (number["lat"], number["lon"], altitude_m if math.isfinite(altitude_m) else 0.0),
        number.get("accuracy", math.nan) / ACCURACY_PER_STD,
        number.get("speed", math.nan),
        number.get("bearing", math.nan),
    )


def _add(sensors: dict[str, _Sensor], kind: str, cells: list[str]) -> None:
    unix_ms, boot_ns = float(cells[0]), int(cells[1] or 0)
    xyz = [float(cell) for cell in cells[2:5]]
    if len(xyz) < 3 or not abs(unix_ms) * 1e6 < 2**62 or abs(boot_ns) > 2**61:
        raise ValueError("no three axes, or no time")
    if kind.startswith("Uncal") and len(cells) >= 8:
        # Of an uncalibrated sensor the phone's own estimate of the bias stands behind it.
        xyz = [value - float(bias) for value, bias in zip(xyz, cells[5:8], strict=True)]
    sensor = sensors.setdefault(kind, _Sensor(array("d"), array("q"), array("d")))
    sensor.unix_ms.append(unix_ms)
    sensor.boot_ns.append(boot_ns)
    sensor.xyz.extend(xyz)


def _of_fixes(fixes: list[_Fix]) -> dict[str, Stream]:
    stamps_ns = np.array([fix.stamp_ns for fix in fixes], dtype=np.int64)
    rows = np.array([(*fix.place, fix.std_m) for fix in fixes])
    streams = {"gnss": stream_of("gnss", stamps_ns, rows)}
    speed = np.array([fix.speed_mps for fix in fixes])
    told = np.isfinite(speed)
    if told.any():
        streams["speed"] = stream_of("speed", stamps_ns[told], speed[told, np.newaxis])
    bearing = np.array([fix.bearing_deg for fix in fixes])
    sure = np.isfinite(bearing) & (np.nan_to_num(speed) >= MIN_COURSE_MPS)
    if sure.any():
        yaw = np.array([yaw_rad_of(one) for one in bearing[sure].tolist()])
        streams["heading"] = stream_of("heading", stamps_ns[sure], yaw[:, np.newaxis])
    return streams


def _utc_of_boot_ns(fixes: list[_Fix]) -> int | None:
    """Return what to add to ns since boot, by the first fix that tells both clocks."""
    return next((fix.stamp_ns - fix.boot_ns for fix in fixes if fix.boot_ns), None)


def _imu(
    sensors: dict[str, _Sensor], turn: Array | None, utc_of_boot_ns: int | None
) -> Stream | None:
    """Return the gyroscope's samples with the accelerometer's last ones, in the car's axes."""
    rate = sensors.get("Gyro") or sensors.get("UncalGyro")
    accel = sensors.get("Accel") or sensors.get("UncalAccel")
    if turn is None or rate is None or accel is None:
        return None
    stamps_ns, accel_ns = (_stamps_ns(one, utc_of_boot_ns) for one in (rate, accel))
    order = np.argsort(accel_ns, kind="stable")
    accel_ns, forces = accel_ns[order], _vectors(accel)[order]
    last = np.searchsorted(accel_ns, stamps_ns, side="right") - 1
    told = (last >= 0) & (stamps_ns - accel_ns[last] <= _FRESH_NS)
    turned = np.hstack([forces[last[told]] @ turn.T, _vectors(rate)[told] @ turn.T])
    return stream_of("imu", stamps_ns[told], turned)


def _vectors(sensor: _Sensor) -> Array:
    return np.frombuffer(sensor.xyz).reshape(-1, 3)


def _stamps_ns(sensor: _Sensor, utc_of_boot_ns: int | None) -> Stamps:
    boot_ns = np.frombuffer(sensor.boot_ns, dtype=np.int64)
    if utc_of_boot_ns is not None and boot_ns.all():
        return boot_ns + utc_of_boot_ns
    return np.round(np.frombuffer(sensor.unix_ms) * 1e6).astype(np.int64)


def _unit(axis: Axis) -> Array:
    vector = np.zeros(3)
    vector["xyz".index(axis[-1])] = -1.0 if axis.startswith("-") else 1.0
    return vector
