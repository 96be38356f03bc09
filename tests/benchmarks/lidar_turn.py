"""A turn of 32 x 1,024 rays in a World with over 1,000 parts, against the 100 ms of 10 Hz."""

from __future__ import annotations

import os
from pathlib import Path

import msgspec
import numpy as np

import foretwin
from foretwin.contracts.frames import LocalPose
from foretwin.sim_worker.sensors.base_motion import BaseMotion
from foretwin.sim_worker.sensors.kinds import Lidar
from foretwin.sim_worker.sensors.lidar import scan
from foretwin.sim_worker.sensors.moving_boxes import MovingBoxes
from foretwin.sim_worker.sensors.ray_world import RayWorld
from foretwin.sim_worker.sensors.sensor_file import load_sensor
from tests.benchmarks.measuring import Measurement, UnavailableError, cpu_minimum_s

ALLOWED_S, FEWEST_PARTS, REPEATS = 0.1, 1000, 10
JUNCTION = "Leipziger Straße \u00d7 Markgrafenstraße"


def measure() -> Measurement:
    """Return CPU seconds of one turn, drawn from a car and among 20 cars that drive 14 m/s."""
    rays, seconds = RayWorld(world()), {}
    if rays.parts < FEWEST_PARTS:
        raise AssertionError(f"the World has {rays.parts} parts")
    hdl = load_sensor("hdl_32e")
    sensor = msgspec.structs.replace(
        hdl, lidar=msgspec.structs.replace(hdl.measures(Lidar), azimuths=1024)
    )
    for name, speed_mps in (("standing", 0.0), ("driving", 14.0)):
        motion, among = BaseMotion(LocalPose(-20.0, -2.0, 0.1), speed_mps), cars(speed_mps)
        points = len(scan(rays, sensor, motion, among).points)
        if points < 10_000:
            raise AssertionError(f"only {points} rays came back")
        seconds[name] = cpu_minimum_s(lambda m=motion, b=among: scan(rays, sensor, m, b),
                                      repeats=REPEATS)  # fmt: skip
    more = {"parts": rays.parts, "standing_s": seconds["standing"]}
    return Measurement(seconds["driving"], "CPU s", ALLOWED_S, more)


def world() -> foretwin.World:
    """The junction and 350 m around it."""
    folder = os.environ.get("FORETWIN_DATA")
    if folder is None:
        raise UnavailableError("FORETWIN_DATA names no folder of maps")
    town = foretwin.open_map(Path(folder) / "osm-berlin-mitte" / "berlin-mitte.osm")
    (chosen,) = (one for one in town.intersections if one.name == JUNCTION)
    return town.world(chosen.id, radius_m=350.0)


def cars(speed_mps: float) -> MovingBoxes:
    """Twenty cars on both sides of a street."""
    x = np.linspace(-60.0, 60.0, 10)
    xy = np.concatenate([np.column_stack([x, np.full(10, y)]) for y in (2.0, 6.0)])
    size = np.tile([4.5, 1.8, 1.5], (20, 1))
    return MovingBoxes(
        xy,
        np.full(20, 0.1),
        size,
        np.full(20, speed_mps),
        np.full(20, 0.4),
        np.full(20, 10.0),
        np.full((20, 3), 0.5),
    )
