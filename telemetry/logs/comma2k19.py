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

from pathlib import Path

import numpy as np

from foretwin.contracts.arrays import Array, Stamps
from foretwin.contracts.errors import one_line
from foretwin.contracts.frames import geo_from_ecef
from foretwin.telemetry.logs.columns import stream_of, table_log
from foretwin.telemetry.logs.log import MOST_TIME_S, Log, LogError

MOST_VALUE = 1e12


def is_comma2k19(folder: Path) -> bool:
    """Tell whether a folder is a segment."""
    return (folder / "processed_log").is_dir() or (folder / "global_pose").is_dir()


def open_comma2k19(folder: Path) -> Log:
    """Open a segment folder; raises LogError for arrays that are broken or do not fit."""
    read = {
        "gnss": _positions(folder),
        "heading": _headings(folder),
        "imu": _imu(folder),
        "speed": _column(folder, "processed_log/CAN/speed", 1),
        "steering": _steering_wheel(folder),
    }
    present = {
        channel: stream_of(channel, _stamps_ns(timed[0]), timed[1])
        for channel, timed in read.items()
        if timed is not None
    }
    if "gnss" not in present:
        raise LogError(f"{folder}: no global_pose/frame_positions: a drive needs positions")
    stamps_ns = np.sort(np.concatenate([stream.stamps_ns for stream in present.values()]))
    return table_log(
        folder.name,
        present,
        stamps_ns=stamps_ns[stamps_ns >= 0],
        time_base="boot",
        reference_point="camera",
    )


def _array(folder: Path, name: str, columns: int) -> Array | None:
    """Return an array of shape (N, columns), or None where the file is absent."""
    path = folder / name
    if not path.is_file():
        return None
    try:
        # Mapped, it is as long as the file, whatever its header says.
        mapped = np.load(path, allow_pickle=False, mmap_mode="r")
        if mapped.dtype.kind not in "fiu":
            raise TypeError(f"it holds {mapped.dtype}")
        array: Array = mapped.astype(np.float64)
        # Nothing that was measured is so large: it counts as no number, and is refused with those.
        return np.where(np.abs(array) < MOST_VALUE, array, np.nan).reshape(len(array), columns)
    except Exception as error:  # NumPy evaluates a header, and raises what that raises
        text = f"{path}: no NumPy array of {columns} column(s): {one_line(error)}"
        raise LogError(text) from None


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


def _steering_wheel(folder: Path) -> tuple[Array, Array] | None:
    angle = _column(folder, "processed_log/CAN/steering_angle", 1)
    return None if angle is None else (angle[0], np.radians(angle[1]))


def _stamps_ns(time_s: Array) -> Stamps:
    # An unreadable time becomes one before zero, which is refused and counted with the others.
    known = np.abs(time_s) < MOST_TIME_S  # false for NaN
    return np.round(np.where(known, time_s, -1e-9) * 1e9).astype(np.int64)
