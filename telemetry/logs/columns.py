"""Messages as columns of numbers, for logs that are tables: CSV, NumPy arrays, lines of positions.

A channel's fields have the names of its section in a declaration, in the project's units.
"""

from __future__ import annotations

import itertools
from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from typing import Any, NamedTuple

import msgspec
import numpy as np

from foretwin.contracts import drive
from foretwin.contracts.arrays import Array, Indices, Stamps
from foretwin.contracts.frames import GeoPoint
from foretwin.telemetry.logs.log import UNREADABLE_ROW, Log, Sample
from foretwin.telemetry.logs.merge import merged
from foretwin.telemetry.logs.one_drive import of_one_drive


class ChannelColumns(NamedTuple):
    """The fields of a channel in a declaration's section, and how a message gives or takes them.

    `message` takes the stamp and a number for each field, None where the table has no such column.
    """

    section: str
    fields: tuple[str, ...]
    numbers: Callable[[Any], tuple[float | None, ...]]
    message: Callable[..., msgspec.Struct]


def _fix(stamp_ns: int, lat_deg: float, lon_deg: float, alt_m: float, std_m: float | None) -> Any:
    # 0, -1 and nothing stand where a receiver knows none.
    known_m = std_m if std_m is not None and std_m > 0.0 else None
    position = GeoPoint(lat_deg, lon_deg, alt_m)
    return drive.GnssFix(stamp_ns=stamp_ns, position=position, std_m=known_m)


def _speed(stamp_ns: int, forward: float) -> Any:
    return drive.SpeedSample(stamp_ns=stamp_ns, speed_mps=forward)


def _heading(stamp_ns: int, yaw: float, yaw_rate: float | None) -> Any:
    return drive.HeadingSample(stamp_ns=stamp_ns, yaw_rad=yaw, yaw_rate_radps=yaw_rate)


def _imu(stamp_ns: int, *numbers: float) -> Any:
    accel, rate = numbers[:3], numbers[3:]
    return drive.ImuSample(stamp_ns=stamp_ns, accel_mps2=accel, rate_radps=rate)  # type: ignore[arg-type]


def _steering(stamp_ns: int, wheel: float | None, tire: float | None) -> Any:
    return drive.SteeringSample(stamp_ns=stamp_ns, steering_wheel_rad=wheel, tire_angle_rad=tire)


def _control(stamp_ns: int, accel: float, wheel: float | None, tire: float | None) -> Any:
    return drive.ControlCommand(
        stamp_ns=stamp_ns, accel_mps2=accel, steering_wheel_rad=wheel, tire_angle_rad=tire
    )


CHANNEL_COLUMNS: Mapping[str, ChannelColumns] = {
    "gnss": ChannelColumns(
        "position",
        ("latitude", "longitude", "altitude", "std"),
        lambda m: (m.position.lat_deg, m.position.lon_deg, m.position.alt_m, m.std_m),
        _fix,
    ),
    "speed": ChannelColumns("speed", ("forward",), lambda m: (m.speed_mps,), _speed),
    "heading": ChannelColumns(
        "heading", ("yaw", "yaw_rate"), lambda m: (m.yaw_rad, m.yaw_rate_radps), _heading
    ),
    "imu": ChannelColumns(
        "imu",
        ("accel_x", "accel_y", "accel_z", "rate_x", "rate_y", "rate_z"),
        lambda m: (*m.accel_mps2, *m.rate_radps),
        _imu,
    ),
    "steering": ChannelColumns(
        "steering",
        ("wheel", "tire"),
        lambda m: (m.steering_wheel_rad, m.tire_angle_rad),
        _steering,
    ),
    "control": ChannelColumns(
        "control",
        ("accel", "wheel", "tire"),
        lambda m: (m.accel_mps2, m.steering_wheel_rad, m.tire_angle_rad),
        _control,
    ),
}


class Stream(NamedTuple):
    """The samples of a channel: stamps (N,), and (N,) numbers by field."""

    stamps_ns: Stamps
    columns: Mapping[str, Array]

    def of(self, rows: Indices) -> Stream:
        """Return those of some rows (K,), in their order."""
        columns = {name: column[rows] for name, column in self.columns.items()}
        return Stream(self.stamps_ns[rows], columns)


def stream_of(channel: str, stamps_ns: Stamps, array: Array) -> Stream:
    """Return the stream of an array (N, F) with the channel's first F fields, in their order."""
    return Stream(stamps_ns, dict(zip(CHANNEL_COLUMNS[channel].fields, array.T, strict=False)))


def table_log(
    source: str,
    streams: Mapping[str, Stream],
    *,
    stamps_ns: Stamps,
    time_base: drive.TimeBase,
    reference_point: str,
    body_from_antenna_m: drive.Vector3 | None = None,
    unreadable: int = 0,
    refused: Mapping[str, int] | None = None,
) -> Log:
    """Return the log of streams by channel; the drive lasts from the earliest stamp to the latest.

    `unreadable` rows, and what a reader has `refused` by reason, are counted with what is refused,
    and so are samples whose stamps cannot be of one drive.
    """
    kept = {}
    counted = Counter(refused or {})
    for channel, stream in streams.items():
        rows, why = of_one_drive(stream.stamps_ns, time_base)
        kept[channel] = stream.of(rows)
        counted += why
    rows, _ = of_one_drive(stamps_ns, time_base)
    stamps_ns = stamps_ns[rows]
    start_ns = int(stamps_ns[np.argmax(stamps_ns >= 0)])

    def read(skipped: Counter[str]) -> Iterator[Sample]:
        if unreadable:
            skipped[UNREADABLE_ROW] += unreadable
        skipped.update(counted)
        return merged(*(_samples(channel, stream) for channel, stream in kept.items()))

    return Log(
        info=drive.VehicleInfo(
            vehicle_id="car",
            time_base=time_base,
            start_stamp_ns=start_ns,
            end_stamp_ns=int(stamps_ns[-1]),
            source=source,
            reference_point=reference_point,
            body_from_antenna_m=body_from_antenna_m,
            sends=tuple(streams),
        ),
        read=read,
    )


def _samples(channel: str, stream: Stream) -> Iterator[Sample]:
    row = CHANNEL_COLUMNS[channel]
    numbers = (
        stream.columns[field].tolist() if field in stream.columns else itertools.repeat(None)
        for field in row.fields
    )
    for stamp_ns, *values in zip(stream.stamps_ns.tolist(), *numbers, strict=False):
        yield channel, row.message(stamp_ns, *values)
