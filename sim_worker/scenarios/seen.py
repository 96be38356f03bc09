"""Road users that the real car detected, as members of every future's cast."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from foretwin.contracts.arrays import Array
from foretwin.contracts.frames import wrap_angle
from foretwin.contracts.futures import SeenRoadUser
from foretwin.contracts.world import Lane
from foretwin.geometry.frenet_path import FrenetPath
from foretwin.sim_worker.road_users.cast import Player
from foretwin.sim_worker.scenarios.roads import RoadNetwork

_LANE_WITHIN_M = 1.8
_LANE_WITHIN_RAD = math.radians(35.0)
_STRAIGHT_M = 200.0
_STANDS_MPS = 0.3


class SeenActors:
    """Detected road users of one World: along the lane they are on, lawfully, else straight on.

    One that stands is taken to stay where it is: whether it waits or is parked cannot be seen.
    """

    def __init__(self, network: RoadNetwork) -> None:
        self._network = network
        self._lanes = LaneSearch(tuple(network.lanes.values()))
        self._path_of_lane: dict[str, FrenetPath] = {}

    def actors(self, users: Sequence[SeenRoadUser]) -> tuple[Player, ...]:
        """Return the road users as players; those on the same lane have the same path."""
        return tuple(
            _actor(number, user, self._lane_path(user)) for number, user in enumerate(users)
        )

    def _lane_path(self, user: SeenRoadUser) -> FrenetPath | None:
        if user.kind == "pedestrian" or user.speed_mps < _STANDS_MPS:
            return None
        lane = self._lanes.under(np.array([user.x_m, user.y_m]), user.yaw_rad)
        if lane is None:
            return None
        if lane.id not in self._path_of_lane:
            self._path_of_lane[lane.id] = self._network.lane_way(lane).path.eased
        return self._path_of_lane[lane.id]


def _actor(number: int, user: SeenRoadUser, path: FrenetPath | None) -> Player:
    place = np.array([[user.x_m, user.y_m]])
    stands, lawful = user.speed_mps < _STANDS_MPS, path is not None
    if path is None:
        ahead = np.array([math.cos(user.yaw_rad), math.sin(user.yaw_rad)])
        path = FrenetPath(place + np.array([[0.0], [_STRAIGHT_M]]) * ahead)
        arc, offset = 0.0, 0.0
    else:
        on_path = path.locate(place)
        arc, offset = float(on_path.arc_m[0]), float(on_path.offset_m[0])
    return Player(
        name=f"seen {user.user_id or number}",  # how it drives is drawn by its name
        kind=user.kind,
        path=path,
        start_arc_m=arc,
        speed_mps=user.speed_mps,
        conduct="law_abiding" if lawful else "parked" if stands else "heedless",
        lateral_m=offset,
        size_m=(user.length_m, user.width_m),
        known=True,
    )


class LaneSearch:
    """The steps of all lanes of a World in one array, to find the lane under a road user."""

    def __init__(self, lanes: Sequence[Lane]) -> None:
        self._lanes = tuple(lanes)
        lines = [lane.centerline for lane in lanes]
        self._from = np.concatenate([line[:-1] for line in lines] or [np.zeros((0, 2))])
        self._steps = np.concatenate([np.diff(line, axis=0) for line in lines] or [self._from])
        self._square = np.maximum(np.square(self._steps).sum(axis=1), 1e-18)
        self._heading = np.arctan2(self._steps[:, 1], self._steps[:, 0])
        steps = np.array([len(line) - 1 for line in lines], dtype=np.intp)
        self._lane_of = np.repeat(np.arange(len(lines)), steps)

    def under(self, xy_m: Array, yaw_rad: float) -> Lane | None:
        """Return the lane that a road user at (2,) is on and heads along, the nearest of them."""
        to_user = xy_m - self._from
        along = np.clip((to_user * self._steps).sum(axis=1) / self._square, 0.0, 1.0)
        away = np.hypot(*(to_user - along[:, None] * self._steps).T)
        best, best_m = None, _LANE_WITHIN_M
        near = np.flatnonzero(away < _LANE_WITHIN_M)
        for lane in np.unique(self._lane_of[near]):
            mine = near[self._lane_of[near] == lane]
            step = mine[away[mine].argmin()]
            turned = abs(float(wrap_angle(self._heading[step] - yaw_rad)))
            if away[step] < best_m and turned < _LANE_WITHIN_RAD:
                best, best_m = self._lanes[lane], float(away[step])
        return best
