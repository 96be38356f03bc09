"""A picture of 640 by 480 in a World with over 1,000 parts, against the 100 ms of 10 Hz."""

from __future__ import annotations

from foretwin.contracts.errors import UserError
from foretwin.contracts.frames import LocalPose
from foretwin.sim_worker.sensors.base_motion import BaseMotion
from foretwin.sim_worker.sensors.camera import CameraWorld, message_of
from foretwin.sim_worker.sensors.sensor_file import load_sensor
from tests.benchmarks.lidar_turn import cars, world
from tests.benchmarks.measuring import Measurement, UnavailableError, cpu_minimum_s

ALLOWED_S, REPEATS = 0.1, 10


def measure() -> Measurement:
    """Return CPU seconds, of all threads, of one picture with its JPEG, among 20 cars."""
    sensor, motion, among = (
        load_sensor("vga_camera"),
        BaseMotion(LocalPose(-20.0, -2.0, 0.1)),
        cars(0),
    )
    try:
        drawn = CameraWorld(world(), sensor)
    except UserError as why:
        raise UnavailableError(str(why)) from why
    seen = int((drawn.view(motion, among).body >= 0).sum())
    if seen < 1000:
        raise AssertionError(f"cars on {seen} pixels alone")
    alone = cpu_minimum_s(lambda: drawn.picture(motion, among), repeats=REPEATS)
    whole = cpu_minimum_s(
        lambda: message_of(drawn.picture(motion, among), sensor, stamp_ns=0), repeats=REPEATS
    )
    drawn.close()
    return Measurement(whole, "CPU s", ALLOWED_S, {"without_jpeg_s": alone, "pixels_of_cars": seen})
