"""Reader of openpilot's logs (comma.ai): rlog and qlog, plain, bz2 or zstd.

Declares, by openpilot's schemas (cereal, MIT), of which the places of the fields below are all that
is kept here: nanoseconds since the device booted (`logMonoTime`, when a message was sent), degrees
on WGS84 and metres of the GNSS antenna in the device behind the windscreen, its bearing in degrees
clockwise from north, m/s, and degrees at the steering wheel, positive to the left. Accelerometer
and gyroscope are in the sensor's axes, which openpilot's locationd turns by (-z, -y, -x) into the
device's forward, right, down; the device's tilt against the car is left in. An accuracy is taken as
one standard deviation on each axis, as the schema presumes.

A qlog holds every tenth message or so, and its two sensors seldom together: what is told of one
alone is counted as left out. Files that Cap'n Proto's own library wrote with openpilot's schemas
are read (tests/data/comma), and a real qlog of a minute on a motorway; no rlog could be had.
"""

from __future__ import annotations

import bz2
import math
import re
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import BinaryIO, cast

from foretwin.contracts import drive
from foretwin.contracts.frames import GeoPoint
from foretwin.telemetry.logs.capnp_messages import MessageError, Struct, messages
from foretwin.telemetry.logs.log import (
    FILE_CUT_SHORT,
    MOST_TIME_S,
    UNREADABLE_ROW,
    Log,
    LogError,
    Sample,
)
from foretwin.telemetry.logs.merge import reordered
from foretwin.telemetry.logs.nmea import MIN_COURSE_MPS
from foretwin.telemetry.logs.nmea_sentences import yaw_rad_of
from foretwin.telemetry.ros_messages.foreign import NO_FIX

_NAME = re.compile(r"(?:.*[-_]{2})?[rq]log(?:\.bz2|\.zst)?")
_WHICH_AT = 8
"""Where an Event says what it holds, after its time."""
_SENSORS, _GPS, _CAR, _GPS_OUTSIDE, _ACCELEROMETER, _GYROSCOPE = 10, 20, 21, 47, 96, 97
"""sensorEventsDEPRECATED, gpsLocation, carState, gpsLocationExternal, accelerometer, gyroscope."""
_SENSOR_WHICH_AT = 12
_ACCELERATION, _GYRO, _GYRO_UNCALIBRATED = 0, 3, 6
_HAS_FIX_BIT, _FLAGS_FIX_BIT = 480, 0
_LEFT_BIT, _RIGHT_BIT = 69, 70
_GEARS: dict[int, drive.Gear] = {1: "park", 2: "drive", 3: "neutral", 4: "reverse"}
_INDICATORS: dict[tuple[bool, bool], drive.Indicator] = {
    (False, False): "off", (True, False): "left", (False, True): "right", (True, True): "hazard",
}  # fmt: skip
_WINDOW_NS = 1_000_000_000
_FRESH_NS = 100_000_000
_NO_ACCELERATION = "gyroscope without accelerometer"
_MOST_NS = int(MOST_TIME_S * 1e9)
_DAMAGED = (MessageError, OSError, EOFError, ValueError)


def is_comma_log(path: Path) -> bool:
    """Tell by its name whether a file is an rlog or a qlog."""
    return _NAME.fullmatch(path.name) is not None


def open_comma_log(path: Path) -> Log:
    """Open a log; raises LogError where it is none, or tells no position with a fix."""
    first_ns = last_ns = None
    sends: dict[str, None] = {}
    outside = False
    refused: Counter[str] = Counter()
    for event in _events(path, refused):
        outside = outside or _which(event) == _GPS_OUTSIDE
    for channel, said in _samples(path, outside, Counter()):
        stamp_ns = said.stamp_ns  # type: ignore[attr-defined]
        sends[channel] = None
        first_ns = stamp_ns if first_ns is None else min(first_ns, stamp_ns)
        last_ns = stamp_ns if last_ns is None else max(last_ns, stamp_ns)
    if first_ns is None or "gnss" not in sends:
        why = f" ({', '.join(refused)})" if refused else ""
        raise LogError(f"{path}: no gpsLocation with a fix in it{why}, so no positions")
    return Log(
        info=drive.VehicleInfo(
            vehicle_id="car",
            time_base="boot",
            start_stamp_ns=first_ns,
            end_stamp_ns=last_ns,
            source=path.name,
            reference_point="GNSS antenna of the device behind the windscreen",
            sends=tuple(sends),
        ),
        read=lambda skipped: reordered(_samples(path, outside, skipped), window_ns=_WINDOW_NS),
    )


@contextmanager
def _opened(path: Path) -> Iterator[Callable[[int], bytes]]:
    with path.open("rb") as file:
        magic = file.read(4)
        file.seek(0)
        if magic.startswith(b"BZh"):
            with bz2.open(file) as unpacked:
                yield cast(BinaryIO, unpacked).read
        elif magic == b"\x28\xb5\x2f\xfd":
            import zstandard

            with zstandard.ZstdDecompressor(max_window_size=1 << 27).stream_reader(
                file, read_across_frames=True
            ) as stream:
                yield stream.read
        else:
            yield file.read


def _events(path: Path, skipped: Counter[str]) -> Iterator[Struct]:
    """Yield every Event; what comes after damage is lost, and said."""
    from zstandard import ZstdError

    try:
        with _opened(path) as read:
            yield from messages(read)
    except (*_DAMAGED, ZstdError) as error:
        if isinstance(error, OSError) and error.errno is not None:
            raise
        skipped[FILE_CUT_SHORT] += 1


def _which(event: Struct) -> int:
    return int(event.number("H", _WHICH_AT))


def _samples(path: Path, outside: bool, skipped: Counter[str]) -> Iterator[Sample]:
    accel: tuple[int, drive.Vector3] | None = None
    for event in _events(path, skipped):
        which, stamp_ns = _which(event), int(event.number("Q", 0))
        try:
            if stamp_ns >= _MOST_NS:
                raise MessageError("no time since boot")
            if which == (_GPS_OUTSIDE if outside else _GPS):
                yield from _gps(event, stamp_ns, skipped)
            elif which == _CAR:
                yield from _car(event, stamp_ns)
            elif which in (_SENSORS, _ACCELEROMETER, _GYROSCOPE):
                for reading in _readings(event, which):
                    kind = int(reading.number("H", _SENSOR_WHICH_AT))
                    if kind == _ACCELERATION:
                        accel = (stamp_ns, _in_the_cars_axes(reading))
                    elif kind in (_GYRO, _GYRO_UNCALIBRATED):
                        yield from _imu(stamp_ns, accel, _in_the_cars_axes(reading), skipped)
        except MessageError:
            skipped[UNREADABLE_ROW] += 1


def _readings(event: Struct, which: int) -> list[Struct]:
    if which == _SENSORS:
        return event.structs(0)
    one = event.struct(0)
    return [] if one is None else [one]


def _imu(
    stamp_ns: int,
    accel: tuple[int, drive.Vector3] | None,
    rate_radps: drive.Vector3,
    skipped: Counter[str],
) -> Iterator[Sample]:
    """Yield the gyroscope's sample with the accelerometer's last, where that is fresh."""
    if accel is None or stamp_ns - accel[0] > _FRESH_NS:
        skipped[_NO_ACCELERATION] += 1
        return
    sample = drive.ImuSample(stamp_ns=stamp_ns, accel_mps2=accel[1], rate_radps=rate_radps)
    yield "imu", sample


def _gps(event: Struct, stamp_ns: int, skipped: Counter[str]) -> Iterator[Sample]:
    said = event.struct(0)
    # hasFix came later; before it the first flag said so.
    if said is None or not (said.bit(_HAS_FIX_BIT) or said.bit(_FLAGS_FIX_BIT)):
        skipped[NO_FIX] += 1
        return
    accuracy_m = said.number("f", 36)
    position = GeoPoint(said.number("d", 8), said.number("d", 16), said.number("d", 24))
    std_m = accuracy_m if accuracy_m > 0.0 and math.isfinite(accuracy_m) else None
    yield "gnss", drive.GnssFix(stamp_ns=stamp_ns, position=position, std_m=std_m)
    speed_mps, bearing_deg = said.number("f", 4), said.number("f", 32)
    if speed_mps >= MIN_COURSE_MPS and math.isfinite(bearing_deg):
        yaw_rad = yaw_rad_of(bearing_deg)
        yield "heading", drive.HeadingSample(stamp_ns=stamp_ns, yaw_rad=yaw_rad)


def _car(event: Struct, stamp_ns: int) -> Iterator[Sample]:
    car = event.struct(0)
    if car is None:
        return
    yield "speed", drive.SpeedSample(stamp_ns=stamp_ns, speed_mps=car.number("f", 0))
    wheel_rad = math.radians(car.number("f", 16))
    yield "steering", drive.SteeringSample(stamp_ns=stamp_ns, steering_wheel_rad=wheel_rad)
    left, right = car.bit(_LEFT_BIT), car.bit(_RIGHT_BIT)
    yield (
        "status",
        drive.VehicleStatus(
            stamp_ns=stamp_ns,
            gear=_GEARS.get(int(car.number("H", 10)), "unknown"),
            indicator=_INDICATORS[left, right],
        ),
    )


def _in_the_cars_axes(reading: Struct) -> drive.Vector3:
    """Return forward, left, up of a sensor's x, y, z; raises MessageError unless it has three."""
    vector = reading.struct(0)
    values = vector.floats(0) if vector is not None else ()
    if len(values) < 3:
        raise MessageError("a sensor without three axes")
    x, y, z = values[:3]
    # locationd: forward, right, down = -z, -y, -x.
    return -z, y, x
