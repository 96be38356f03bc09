"""Other road users as a driver sees them: places on the ego's path."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from contracts.arrays import Array
from contracts.vehicle import VehicleParameters
from sim_worker.planners.path import FrenetPath, FrenetPoint
from sim_worker.stage_model import ROAD_USER_LENGTH_M, ROAD_USER_WIDTH_M
from sim_worker.vehicle.planar import box_centre_from_base_m

_MARGIN_M = 0.3
"""What passes the car's side by less than this is in its way."""


class Leads(NamedTuple):
    """Road users as seen from the path, each (T, S); `rear_arc_m` infinite where there is none."""

    rear_arc_m: Array
    offset_m: Array
    half_width_m: Array
    speed_mps: Array


def see_road_users(path: FrenetPath, poses: Array, speed_mps: Array) -> Leads:
    """Place road users, (S, T, 3) poses with NaN where none and (S,) speeds, on the ego's path."""
    count, ticks = poses.shape[:2]
    arc, offset = np.full((count, ticks), np.inf), np.zeros((count, ticks))
    half_width, speed = np.zeros((count, ticks)), np.zeros((count, ticks))
    there = np.flatnonzero(np.isfinite(poses[:, 0, 0]))
    if len(there):
        found = poses[there].reshape(-1, 3)
        place = path.locate(found[:, :2])
        heading = path.pose_at(place.arc_m).yaw_rad
        cos, sin = np.cos(found[:, 2] - heading), np.sin(found[:, 2] - heading)
        along = (ROAD_USER_LENGTH_M * np.abs(cos) + ROAD_USER_WIDTH_M * np.abs(sin)) / 2.0
        across = (ROAD_USER_LENGTH_M * np.abs(sin) + ROAD_USER_WIDTH_M * np.abs(cos)) / 2.0
        shape = (len(there), ticks)
        arc[there] = (place.arc_m - along).reshape(shape)
        offset[there] = place.offset_m.reshape(shape)
        half_width[there] = across.reshape(shape)
        speed[there] = speed_mps[there, None] * cos.reshape(shape)
    return Leads(arc.T.copy(), offset.T.copy(), half_width.T.copy(), speed.T.copy())


class Lead(NamedTuple):
    """What is ahead of S cars: bumper to bumper, infinite without a lead, and its speed; (S,)."""

    gap_m: Array
    speed_mps: Array


class Sight:
    """Which road users are in the way of cars at their places on the path, tick by tick."""

    def __init__(self, leads: Leads, vehicle: VehicleParameters) -> None:
        self._length_m = vehicle.length_m.value
        front = box_centre_from_base_m(vehicle) + self._length_m / 2.0
        self._gap_from_m = leads.rear_arc_m - front
        self._offset_m, self._speed_mps = leads.offset_m, leads.speed_mps
        self._beside_m = leads.half_width_m + vehicle.width_m.value / 2.0 + _MARGIN_M

    def at(self, tick: int, place: FrenetPoint) -> Lead:
        """Return what is ahead of base_link at `place` (S,) at a control tick."""
        gap = self._gap_from_m[tick] - place.arc_m
        in_way = np.abs(self._offset_m[tick] - place.offset_m) < self._beside_m[tick]
        in_way &= gap > -self._length_m
        return Lead(np.where(in_way, gap, np.inf), np.where(in_way, self._speed_mps[tick], 0.0))
