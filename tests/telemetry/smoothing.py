"""Offline smoothing of a whole log: looks ahead, so it serves as truth in comparisons alone."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from foretwin.contracts.arrays import Array

_MOVING_MPS = 0.5


class SmoothedTrack(NamedTuple):
    """Motion of the positioned point at N stamps, in the frame of the positions.

    `yaw_rad` is the course, unwrapped, and held over stops; `yaw_rate_radps` is 0 there.
    """

    stamp_ns: npt.NDArray[np.int64]
    xy_m: Array
    yaw_rad: Array
    speed_mps: Array
    yaw_rate_radps: Array
    accel_mps2: Array


def smooth_positions(
    stamp_ns: npt.NDArray[np.int64],
    xy_m: Array,
    *,
    position_std_m: float = 0.01,
    jerk_density: float = 4.0,
) -> SmoothedTrack:
    """Smooth N increasing stamps and (N, 2) positions with a model of white jerk on each axis.

    A Kalman filter forward and a Rauch-Tung-Striebel pass back (Bar-Shalom, Li, Kirubarajan 2001,
    8.6). `jerk_density` is in (m/s³)² s. Raises ValueError for fewer than 3 positions or stamps
    that do not increase.
    """
    count = len(stamp_ns)
    steps_s: Array = np.diff(stamp_ns).astype(np.float64) * 1e-9
    if count < 3 or np.any(steps_s <= 0.0):
        raise ValueError(f"{count} positions: smoothing needs at least 3 with increasing stamps")
    predicted, predicted_cov = np.zeros((count, 3, 2)), np.zeros((count, 3, 3))
    filtered, filtered_cov = np.zeros((count, 3, 2)), np.zeros((count, 3, 3))
    transitions = np.zeros((count, 3, 3))
    mean, cov = np.zeros((3, 2)), np.diag([1e4, 1e3, 1e2])
    mean[0] = xy_m[0]
    for i in range(count):
        if i:
            dt = steps_s[i - 1]
            transitions[i] = [[1.0, dt, 0.5 * dt * dt], [0.0, 1.0, dt], [0.0, 0.0, 1.0]]
            noise = jerk_density * np.array(
                [
                    [dt**5 / 20, dt**4 / 8, dt**3 / 6],
                    [dt**4 / 8, dt**3 / 3, dt**2 / 2],
                    [dt**3 / 6, dt**2 / 2, dt],
                ]
            )
            mean = transitions[i] @ mean
            cov = transitions[i] @ cov @ transitions[i].T + noise
        predicted[i], predicted_cov[i] = mean, cov
        gain = cov[:, 0] / (cov[0, 0] + position_std_m**2)
        mean = mean + np.outer(gain, xy_m[i] - mean[0])
        cov = cov - np.outer(gain, cov[0])
        filtered[i], filtered_cov[i] = mean, cov
    smooth = filtered.copy()
    for i in range(count - 2, -1, -1):
        back = filtered_cov[i] @ transitions[i + 1].T @ np.linalg.inv(predicted_cov[i + 1])
        smooth[i] = filtered[i] + back @ (smooth[i + 1] - predicted[i + 1])
    return _track(stamp_ns, smooth)


def _track(stamp_ns: npt.NDArray[np.int64], smooth: Array) -> SmoothedTrack:
    velocity, accel = smooth[:, 1], smooth[:, 2]
    speed = np.hypot(velocity[:, 0], velocity[:, 1])
    moving = speed > _MOVING_MPS
    yaw = np.zeros(len(speed))
    if moving.any():
        course = np.unwrap(np.arctan2(velocity[moving, 1], velocity[moving, 0]))
        # Held, not interpolated: a car that stands keeps the heading it stopped with.
        latest = np.maximum(np.cumsum(moving) - 1, 0)
        yaw = course[latest]
    safe = np.where(moving, speed, 1.0)
    cross = velocity[:, 0] * accel[:, 1] - velocity[:, 1] * accel[:, 0]
    along = np.einsum("ij,ij->i", velocity, accel)
    return SmoothedTrack(
        stamp_ns=stamp_ns,
        xy_m=smooth[:, 0],
        yaw_rad=yaw,
        speed_mps=speed,
        yaw_rate_radps=np.where(moving, cross / safe**2, 0.0),
        accel_mps2=np.where(moving, along / safe, 0.0),
    )
