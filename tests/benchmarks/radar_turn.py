"""A list of a radar among 100 road users in a World with over 1,000 parts, against its 20 Hz."""

from __future__ import annotations

import numpy as np

from foretwin.contracts.frames import LocalPose
from foretwin.sim_worker.sensors.base_motion import BaseMotion
from foretwin.sim_worker.sensors.moving_boxes import MovingBoxes
from foretwin.sim_worker.sensors.radar import detect
from foretwin.sim_worker.sensors.ray_world import RayWorld
from foretwin.sim_worker.sensors.sensor_file import load_sensor
from tests.benchmarks.lidar_turn import cars, world
from tests.benchmarks.measuring import Measurement, cpu_minimum_s

ALLOWED_S, REPEATS = 0.05, 20


def measure() -> Measurement:
    """Return CPU seconds of one list of 100 cars around a car that drives 14 m/s."""
    rays, motion = RayWorld(world()), BaseMotion(LocalPose(-20.0, -2.0, 0.1), 14.0)
    sensor, among = load_sensor("short_range_radar"), five_times(cars(14.0))
    count = len(detect(rays, sensor, motion, among).returns)
    if count < 3:
        raise AssertionError(f"only {count} are seen")
    seconds = cpu_minimum_s(lambda: detect(rays, sensor, motion, among), repeats=REPEATS)
    return Measurement(seconds, "CPU s", ALLOWED_S, {"parts": rays.parts, "seen": count})


def five_times(row: MovingBoxes) -> MovingBoxes:
    """The same street, four more times beside it."""
    aside = [row._replace(xy_m=row.xy_m + np.array([0.0, 8.0 * k])) for k in range(5)]
    return MovingBoxes(*map(np.concatenate, zip(*aside, strict=True)))
