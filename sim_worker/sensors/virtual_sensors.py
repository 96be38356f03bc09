"""Sensors of a car that drives: states and road users in, a cloud out each time a turn is over."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from foretwin.contracts.drive import RoadUser, RoadUsers, VehicleState
from foretwin.contracts.frames import LocalFrame, local_pose
from foretwin.contracts.point_cloud import PointCloud
from foretwin.contracts.setup import SensorSees
from foretwin.contracts.world import World
from foretwin.sim_worker.sensors.lidar import BaseMotion, scan
from foretwin.sim_worker.sensors.ray_world import MovingBoxes, RayWorld, boxes_of
from foretwin.sim_worker.sensors.sensor_file import SensorFile

LIVES_NS = 500_000_000
"""A road user of whom nothing was said for so long is gone, as for the gateway."""
_LATE_TURNS = 3.0
"""A turn that lasts so many times too long had no states: it is begun anew."""


class _LastWord(NamedTuple):
    stamp_ns: int
    user: RoadUser


class _BegunTurn(NamedTuple):
    """As it began: the car, and who was known to be there."""

    state: VehicleState
    said: tuple[_LastWord, ...]


class VirtualSensors:
    """Measures turn after turn; a turn is told when it is over, with what was known as it began.

    A sensor that sees the World measures nothing while there is none. The same input and seed give
    the same clouds, whenever the first state came.
    """

    def __init__(self, sensors: Sequence[tuple[SensorFile, SensorSees]], *, seed: int = 0) -> None:
        self._sensors, self._seed = tuple(sensors), seed
        self._turns: dict[int, _BegunTurn] = {}
        self._said: dict[str, _LastWord] = {}
        self._world: World | None = None
        self._rays: RayWorld | None = None
        self._no_world = RayWorld()

    def use_world(self, world: World | None) -> None:
        """Look into another World from now on, or into none."""
        self._world, self._rays = world, None if world is None else RayWorld(world)

    def take_users(self, users: RoadUsers) -> None:
        """Keep the last word on each road user, whoever says it."""
        for user in users.users:
            known = self._said.get(user.user_id)
            if known is None or users.stamp_ns >= known.stamp_ns:
                self._said[user.user_id] = _LastWord(users.stamp_ns, user)

    def take_state(self, state: VehicleState) -> list[PointCloud]:
        """Return the clouds of turns that are over by now."""
        self._said = {
            name: one
            for name, one in self._said.items()
            if abs(state.stamp_ns - one.stamp_ns) <= LIVES_NS
        }
        found = []
        for number, (sensor, sees) in enumerate(self._sensors):
            turn = self._turns.get(number)
            lasted = -1.0
            if turn is not None:
                period_ns = 1e9 / sensor.lidar.rate_hz
                lasted = (state.stamp_ns - turn.state.stamp_ns) / period_ns
                if 0.0 <= lasted < 1.0:
                    continue
            if turn is not None and 1.0 <= lasted <= _LATE_TURNS:
                found += self._measured(number, sensor, sees, turn)
            self._turns[number] = _BegunTurn(state, tuple(self._said.values()))
        return found

    def _measured(
        self, number: int, sensor: SensorFile, sees: SensorSees, turn: _BegunTurn
    ) -> list[PointCloud]:
        state = turn.state
        rays = self._rays if sees == "world" else self._no_world
        if rays is None or not state.yaw_valid:
            return []
        frame = LocalFrame(state.position) if self._world is None else self._world.frame
        pose = local_pose(frame, state.position, state.yaw_rad)
        motion = BaseMotion(pose, state.speed_mps, state.yaw_rate_radps)
        boxes = _boxes_at(frame, turn)
        seed = (self._seed, number, abs(state.stamp_ns))
        points = scan(rays, sensor, motion, boxes, seed=seed).points
        return [PointCloud(stamp_ns=state.stamp_ns, points=points, sensor=sensor.name)]


def _boxes_at(frame: LocalFrame, turn: _BegunTurn) -> MovingBoxes:
    """Return the road users where they are as a turn begins: they have driven straight on."""
    boxes = boxes_of(frame, [one.user for one in turn.said])
    ages_s = np.array([turn.state.stamp_ns - one.stamp_ns for one in turn.said]) * 1e-9
    way_m = (boxes.speed_mps * ages_s)[:, None]
    along = np.stack([np.cos(boxes.yaw_rad), np.sin(boxes.yaw_rad)], axis=1)
    return boxes._replace(xy_m=boxes.xy_m + way_m * along)
