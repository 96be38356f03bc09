"""Reader of comma2k19 segment folders (comma.ai, 2018): NumPy arrays of CAN, IMU and poses.

Declares: m/s, degrees at the steering wheel, rad/s, m/s², seconds since the device booted,
positions in ECEF metres of the **camera** behind the windscreen (its place on the car is not
documented, so `body_from_antenna_m` is None).

Checked on segment 40 (19th Avenue, San Francisco): the steering angle is positive to the left
(correlation +0.83 of angle times speed with the counter-clockwise yaw rate of the poses), the
gyroscope is positive clockwise about z down (-0.97), and the first column of the pose's rotation
is the camera's forward axis, 0.90° ± 0.11° to the left of the course over ground: the camera's
mounting, which is left in.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from foretwin.contracts.arrays import Array
from foretwin.contracts.drive import (
    GnssFix,
    HeadingSample,
    ImuSample,
    SpeedSample,
    SteeringSample,
    VehicleInfo,
)
from foretwin.contracts.frames import GeoPoint, geo_from_ecef
from foretwin.telemetry.logs.log import Declared, Log, LogError, Sample
from foretwin.telemetry.logs.merge import merged


def is_comma2k19(folder: Path) -> bool:
    """Tell whether a folder is a segment."""
    return (folder / "processed_log").is_dir() or (folder / "global_pose").is_dir()


def open_comma2k19(folder: Path) -> Log:
    """Open a segment folder; raises LogError for arrays that are broken or do not fit."""
    streams = {
        "gnss": _positions(folder),
        "heading": _headings(folder),
        "imu": _imu(folder),
        "speed": _column(folder, "processed_log/CAN/speed", 1),
        "steering": _column(folder, "processed_log/CAN/steering_angle", 1),
    }
    present = {name: stream for name, stream in streams.items() if stream is not None}
    if "gnss" not in present:
        raise LogError(f"{folder}: no global_pose/frame_positions: a drive needs positions")
    stamps_ns = np.concatenate([_stamps_ns(time_s) for time_s, _ in present.values()])
    known_ns = stamps_ns[stamps_ns >= 0]

    def read(_skipped: Counter[str]) -> Iterator[Sample]:
        return merged(*(_samples(name, *stream) for name, stream in present.items()))

    return Log(
        info=VehicleInfo(
            vehicle_id="car",
            time_base="boot",
            start_stamp_ns=int(known_ns.min()),
            end_stamp_ns=int(known_ns.max()),
            source=folder.name,
            reference_point="camera",
            sends=tuple(present),
        ),
        declared=Declared(
            units="m/s, degrees at the steering wheel, rad/s, m/s², m",
            frame="ECEF, WGS84; IMU axes forward, right, down",
            time_base="seconds since the device booted",
            reference_point="camera",
        ),
        read=read,
    )


def _array(folder: Path, name: str, columns: int) -> Array | None:
    """Return an array of shape (N, columns), or None where the file is absent."""
    path = folder / name
    if not path.is_file():
        return None
    try:
        array: Array = np.load(path, allow_pickle=False).astype(np.float64)
        return array.reshape(len(array), columns)
    except (ValueError, TypeError, EOFError, OSError) as error:
        raise LogError(f"{path}: no NumPy array of {columns} column(s): {error}") from None


def _timed(
    folder: Path, time_name: str, value_name: str, columns: int
) -> tuple[Array, Array] | None:
    time_s = _array(folder, time_name, 1)
    value = _array(folder, value_name, columns)
    if time_s is None or value is None:
        return None
    if len(time_s) != len(value):
        raise LogError(
            f"{folder / value_name}: {len(value)} values for the {len(time_s)} times in {time_name}"
        )
    return (time_s[:, 0], value) if np.isfinite(time_s).any() else None


def _column(folder: Path, name: str, columns: int) -> tuple[Array, Array] | None:
    return _timed(folder, f"{name}/t", f"{name}/value", columns)


def _positions(folder: Path) -> tuple[Array, Array] | None:
    stream = _timed(folder, "global_pose/frame_times", "global_pose/frame_positions", 3)
    return None if stream is None else (stream[0], geo_from_ecef(stream[1]))


def _headings(folder: Path) -> tuple[Array, Array] | None:
    """Return times and yaws (N, 1) of the camera's forward axis from true east."""
    pose = _timed(folder, "global_pose/frame_times", "global_pose/frame_orientations", 4)
    position = _positions(folder)
    if pose is None or position is None or len(pose[0]) != len(position[0]):
        return None
    time_s, (w, x, y, z) = pose[0], pose[1].T
    # First column of the rotation matrix of a Hamilton quaternion: the forward axis in ECEF.
    forward = np.stack(
        [1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y + z * w), 2.0 * (x * z - y * w)], axis=1
    )
    lat, lon = np.radians(position[1][:, 0]), np.radians(position[1][:, 1])
    east = np.stack([-np.sin(lon), np.cos(lon), np.zeros_like(lon)], axis=1)
    north = np.stack([-np.sin(lat) * np.cos(lon), -np.sin(lat) * np.sin(lon), np.cos(lat)], axis=1)
    yaw = np.arctan2((forward * north).sum(axis=1), (forward * east).sum(axis=1))
    return time_s, yaw[:, np.newaxis]


def _imu(folder: Path) -> tuple[Array, Array] | None:
    """Return times and (N, 6) specific force and rate, axes forward, left, up."""
    accel = _column(folder, "processed_log/IMU/accelerometer", 3)
    rate = _column(folder, "processed_log/IMU/gyro", 3)
    if accel is None or rate is None or not np.array_equal(accel[0], rate[0], equal_nan=True):
        return None
    left_up = np.array([1.0, -1.0, -1.0])
    return accel[0], np.hstack([accel[1] * left_up, rate[1] * left_up])


def _stamps_ns(time_s: Array) -> np.ndarray[tuple[int], np.dtype[np.int64]]:
    # An unreadable time becomes one before zero, which is refused and counted with the others.
    return np.round(np.where(np.isfinite(time_s), time_s * 1e9, -1.0)).astype(np.int64)


def _samples(name: str, time_s: Array, value: Array) -> Iterator[Sample]:
    for stamp_ns, row in zip(_stamps_ns(time_s).tolist(), value.tolist(), strict=True):
        match name:
            case "gnss":
                yield name, GnssFix(stamp_ns=stamp_ns, position=GeoPoint(*row))
            case "heading":
                yield name, HeadingSample(stamp_ns=stamp_ns, yaw_rad=row[0])
            case "imu":
                accel, rate = (row[0], row[1], row[2]), (row[3], row[4], row[5])
                yield name, ImuSample(stamp_ns=stamp_ns, accel_mps2=accel, rate_radps=rate)
            case "speed":
                yield name, SpeedSample(stamp_ns=stamp_ns, speed_mps=row[0])
            case "steering":
                wheel_rad = float(np.radians(row[0]))
                yield name, SteeringSample(stamp_ns=stamp_ns, steering_wheel_rad=wheel_rad)
