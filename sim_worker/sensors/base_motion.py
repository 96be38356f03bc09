"""How a car goes on while one of its sensors measures, and where the sensor is meanwhile."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from foretwin.contracts.arrays import Array
from foretwin.contracts.frames import LocalPose
from foretwin.contracts.point_cloud import Mount, base_from_mount, origin_m
from foretwin.geometry.constant_turn import constant_turn_rate


class BaseMotion(NamedTuple):
    """Where base_link is as a turn begins, in the World's frame, and how it goes on."""

    pose: LocalPose
    speed_mps: float = 0.0
    yaw_rate_radps: float = 0.0


class SensorMotion(NamedTuple):
    """A sensor at one instant in the World: where (3,), how it moves (3,), and its axes: (3, 3)
    turns vectors of its own axes into the World's."""

    at_m: Array
    velocity_mps: Array
    world_from_sensor: Array


def moved(motion: BaseMotion, time_s: float) -> BaseMotion:
    """Return where base_link is so long after, or before, a motion began."""
    x_m, y_m, yaw = (float(one[0]) for one in poses_after(motion, np.array([time_s])))
    return motion._replace(pose=LocalPose(x_m, y_m, yaw))


def poses_after(motion: BaseMotion, time_s: Array) -> tuple[Array, Array, Array]:
    """Return x, y and yaw (N,) after times (N,) with steady speed and yaw rate."""
    poses = constant_turn_rate(
        np.array([motion.pose.x_m, motion.pose.y_m, motion.pose.yaw_rad]),
        speed_mps=motion.speed_mps,
        yaw_rate_radps=motion.yaw_rate_radps,
        time_s=time_s,
    )
    return poses[:, 0], poses[:, 1], poses[:, 2]


def sensor_motion(motion: BaseMotion, mount: Mount) -> SensorMotion:
    """Return where a sensor is as a motion begins, and how it moves: with the car's turning."""
    x_m, y_m, yaw = motion.pose
    cos, sin = math.cos(yaw), math.sin(yaw)
    world_from_base = np.array([[cos, -sin, 0.0], [sin, cos, 0.0], [0.0, 0.0, 1.0]])
    lever_m = world_from_base @ origin_m(mount)
    swing_mps = motion.yaw_rate_radps * np.array([-lever_m[1], lever_m[0], 0.0])
    return SensorMotion(
        at_m=np.array([x_m, y_m, 0.0]) + lever_m,
        velocity_mps=motion.speed_mps * world_from_base[:, 0] + swing_mps,
        world_from_sensor=world_from_base @ base_from_mount(mount),
    )
