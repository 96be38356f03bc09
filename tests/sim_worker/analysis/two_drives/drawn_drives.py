"""Drives along drawn ways at drawn speeds, as states of an estimator."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from foretwin.contracts.arrays import Array
from foretwin.contracts.drive import VehicleState
from foretwin.contracts.frames import GeoPoint, LocalFrame, geo_from_local, geo_from_local_yaw
from foretwin.geometry.frenet_path import FrenetPath
from foretwin.geometry.polyline import length
from foretwin.sim_worker.analysis.two_drives.drive_line import DriveLine, drive_line

FRAME = LocalFrame(GeoPoint(48.0, 9.0))
RATE_HZ = 10.0
BEND = np.concatenate(
    [
        [[0.0, 0.0]],
        np.column_stack([np.cos(np.linspace(-1.57, 0.0, 40)), np.sin(np.linspace(-1.57, 0.0, 40))])
        * 60.0
        + [200.0, 60.0],
        [[260.0, 300.0]],
    ]
)
"""A straight of 200 m, a bend to the left of 60 m radius, a straight of 240 m."""
LOOP = np.array([[0, 0], [120, 0], [120, 120], [0, 120], [0, 0.0]])


def driven(
    way: Array,
    speed_mps: float | Callable[[float], float],
    *,
    left_m: float = 0.0,
    stands: tuple[float, float] | None = None,
    hole_s: tuple[float, float] | None = None,
    std_m: float | None = 0.02,
    start_s: float = 0.0,
) -> list[VehicleState]:
    """States of a car beside a way, at a speed by place; `stands` (metre, seconds) at a stop, and
    without those of `hole_s`."""
    path = FrenetPath(way)
    arc, speeds, at_m, stood = [], [], 0.0, 0.0
    while at_m < length(way):
        speed = speed_mps(at_m) if callable(speed_mps) else speed_mps
        if stands is not None and at_m >= stands[0] and stood < stands[1]:
            stood, speed = stood + 1.0 / RATE_HZ, 0.0
        arc.append(at_m)
        speeds.append(speed)
        at_m += speed / RATE_HZ
    pose = path.pose_at(np.array(arc), left_m)
    geo = geo_from_local(FRAME, pose.xy_m)
    yaw = geo_from_local_yaw(FRAME, pose.yaw_rad, pose.xy_m)
    states = [
        VehicleState(
            vehicle_id="ego",
            stamp_ns=round((start_s + k / RATE_HZ) * 1e9),
            position=GeoPoint(float(geo[k, 0]), float(geo[k, 1])),
            yaw_rad=float(yaw[k]),
            speed_mps=speeds[k],
            yaw_rate_radps=0.0,
            accel_mps2=0.0,
            position_std_m=std_m,
        )
        for k in range(len(arc))
    ]
    first, last = hole_s or (np.inf, np.inf)
    return [s for k, s in enumerate(states) if not first < k / RATE_HZ < last]


def line(states: list[VehicleState]) -> DriveLine:
    """The line of states in the frame of all drawn drives."""
    found = drive_line(states, FRAME)
    assert found is not None
    return found
