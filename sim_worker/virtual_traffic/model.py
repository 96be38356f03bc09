"""The traffic model as a going simulation: law-abiding drivers who flow along the lanes of Worlds.

They follow, stop and give way as those of futures do (`road_users`), to each other and to the car;
junctions they enter only where they can leave them (`entries`), and who would drive into somebody
all the same brakes in time (`apart`).
Who gets far away from the car goes, and another comes where the car cannot see it come.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from foretwin.contracts.arrays import Array, Indices
from foretwin.contracts.drive import RoadUserKind, SignalColour
from foretwin.contracts.frames import LocalFrame
from foretwin.contracts.vehicle import VehicleParameters
from foretwin.contracts.world import World
from foretwin.geometry.frenet_path import FrenetPath
from foretwin.geometry.polyline import arc_lengths
from foretwin.sim_worker.driver_model import (
    BEND_DECEL_MPS2,
    DECIDE_EVERY_S,
    MAX_DECEL_MPS2,
    UNKNOWN_LIMIT_MPS,
)
from foretwin.sim_worker.road_users.cast import Player, casting
from foretwin.sim_worker.road_users.crowd import EgoBoxes
from foretwin.sim_worker.road_users.manners import key_of, manners
from foretwin.sim_worker.road_users.paces import square_bound
from foretwin.sim_worker.road_users.path_table import PathTable
from foretwin.sim_worker.road_users.right_of_way import JunctionRules, PathRules, Taken
from foretwin.sim_worker.road_users.traffic import Traffic
from foretwin.sim_worker.scenarios.roads import RoadNetwork
from foretwin.sim_worker.scenarios.seen import LaneSearch
from foretwin.sim_worker.vehicle.reference_points import box_centre_from_base_m
from foretwin.sim_worker.vehicle.road_user_kinds import KINDS
from foretwin.sim_worker.virtual_traffic.apart import who_must_brake
from foretwin.sim_worker.virtual_traffic.entries import JunctionEntries, Mover
from foretwin.sim_worker.virtual_traffic.rider import Rider, RoadsInForce
from foretwin.sim_worker.virtual_traffic.source import FIRST_M, STEP_S, UNSEEN_M, VirtualUser

GONE_M = 250.0
"""From the car: who is farther away is replaced. Chosen: Worlds reach 150 m from their junction."""
APART_M = 25.0
"""From others, who comes: it can stop behind them. Chosen: 14 m/s stop within it at 4 m/s²."""
_SHORT_M, _LONG_M = 80.0, 200.0
"""Ways that are shorter are led on, so far."""
_TRIES = 20
_COME_EVERY = 20
"""Steps between two tries to let somebody come."""
_OFF_PATH_M, _SAME_PATH_M, _AHEAD_M = 1.5, 0.5, 60.0
"""A path of the car counts until the car is so far beside it, or the newest one is, or it ends."""
_SHARES: tuple[tuple[RoadUserKind, float], ...] = (
    ("car", 0.82), ("van", 0.08), ("lorry", 0.03), ("motorcycle", 0.03), ("bicycle", 0.04),
)  # fmt: skip
"""Of kinds on the road. Chosen: about what counts in German cities find beside buses."""
_GRIP_MPS2 = MAX_DECEL_MPS2 - 0.5
"""What nobody exceeds, along and across together: 0.76 g."""
_EVERY = round(DECIDE_EVERY_S / STEP_S)


class ModelTraffic:
    """`count` road users of the traffic model around a car; see TrafficSource."""

    def __init__(self, vehicle: VehicleParameters, *, count: int, seed: int) -> None:
        self._count, self._seed = count, seed
        self._rng = np.random.default_rng(seed)
        self._size_m = vehicle.length_m.value, vehicle.width_m.value
        self._ahead_m = box_centre_from_base_m(vehicle)
        self._riders: list[Rider] = []
        self._named = self._steps = 0
        self._roads: RoadsInForce | None = None
        self._car_path: FrenetPath | None = None
        self._car_taken: tuple[Taken, ...] = ()
        self._traffic: Traffic | None = None
        self._rules: PathRules | None = None
        self._columns: dict[str, int] = {}
        self._stale = True
        """Whether who drives where is no longer as the simulation has it."""
        self._colours: Mapping[str, SignalColour] = {}

    @property
    def frame(self) -> LocalFrame | None:
        """That of the World in force."""
        return None if self._roads is None else self._roads.network.world.frame

    def use_world(self, world: World) -> None:
        """Go on in another World; ways are led on along its lanes where they reach them."""
        before, network = self._roads, RoadNetwork(world)
        roads = RoadsInForce(
            network, LaneSearch(tuple(network.lanes.values())), JunctionRules(world)
        )
        self._roads, self._car_path, self._stale = roads, None, True
        self._entries = JunctionEntries(roads.rules)
        for rider in self._riders:
            assert before is not None
            rider.move_into(world.frame, before.network.world.frame, roads.rules)

    def use_path(self, xy_m: Array) -> None:
        """Take where the car will drive, unless it is the way that is known."""
        known = self._car_path
        if known is not None:
            ahead = FrenetPath(xy_m).point_at(np.arange(0.0, _AHEAD_M, 5.0))
            on = known.locate(ahead)
            if np.abs(on.offset_m).max() < _SAME_PATH_M and on.arc_m.max() < known.length_m:
                return
        assert self._roads is not None
        self._car_path = FrenetPath(xy_m)
        self._car_taken, self._stale = self._roads.rules.taken(self._car_path), True

    def step(
        self, car: Array, *, time_s: float, colours: Mapping[str, SignalColour]
    ) -> tuple[VirtualUser, ...]:
        """Move on; see TrafficSource."""
        if self._roads is None:
            return ()
        x, y, yaw, speed = car[:4].tolist()
        ahead = self._ahead_m
        middle = np.array([x + ahead * np.cos(yaw), y + ahead * np.sin(yaw)])
        if self._car_path is None:
            self.use_path(middle + np.array([[0.0], [_AHEAD_M]]) * [np.cos(yaw), np.sin(yaw)])
        self._change_cast(middle)
        if self._stale:
            self._cast_anew()
        traffic, path = self._traffic, self._car_path
        if traffic is None or path is None or self._rules is None:
            return ()
        # Who sees a light change decides at once; so the first step after it is another one. The
        # reaction time of these drivers is for what moves: a red light that the real car is shown
        # must find nobody driving on who could still stop.
        boxes = EgoBoxes(
            np.array([[*middle.tolist(), yaw]]),
            np.array([speed]),
            0,
            path.locate(middle[None]).arc_m,
            *self._size_m,
        )
        grip_mps2 = self._grip_left()
        if self._steps % _EVERY == 0 or colours != self._colours:
            self._colours = dict(colours)
            red = self._rules.red(colours)
            closed = self._entries.closed(traffic, boxes, red)
            traffic.decide(boxes, np.hstack([red, closed]), watch_lights=True)
            traffic.brake_at_most(grip_mps2)
        traffic.brake(who_must_brake(traffic, boxes, grip_mps2), grip_mps2)
        traffic.step(time_s=time_s - STEP_S, dt_s=STEP_S)
        self._steps += 1
        for rider in self._riders:
            column = self._columns[rider.name]
            rider.arc_m = float(traffic.arc_m[0, column])
            rider.speed_mps = float(traffic.speed_mps[0, column])
        return tuple(self._user(rider, traffic) for rider in self._riders)

    def _grip_left(self) -> Array:
        """Return (R,) what tyres still give along the way beside what bends take of it."""
        left = np.zeros(len(self._riders))
        for rider in self._riders:
            bend = rider.path.at_nodes(rider.path.curvature_pm, np.array([rider.arc_m]))[0]
            across = rider.speed_mps**2 * float(bend)
            left[self._columns[rider.name]] = max(_GRIP_MPS2**2 - across**2, 0.0) ** 0.5
        return left

    def _user(self, rider: Rider, traffic: Traffic) -> VirtualUser:
        x, y, yaw = traffic.poses[0, self._columns[rider.name]].tolist()
        return VirtualUser(rider.name, rider.kind, x, y, yaw, rider.speed_mps, *rider.size_m)

    def _change_cast(self, car_xy: Array) -> None:
        """Let those go and come who do it unseen, and lead short ways on."""
        roads = self._roads
        assert roads is not None
        for rider in list(self._riders):
            away_m = float(np.hypot(*(_place(rider) - car_xy)))
            if away_m > GONE_M or (away_m > UNSEEN_M and rider.left_m < 0.0):
                self._riders.remove(rider)
                self._stale = True
        if any(one.left_m < _SHORT_M and not one.ended for one in self._riders):
            for rider in self._riders:
                if rider.left_m < (_SHORT_M + _LONG_M) / 2.0:
                    self._stale |= rider.lead_on(roads, _LONG_M, self._rng)
        begins = self._traffic is None
        if len(self._riders) < self._count and (begins or self._steps % _COME_EVERY == 0):
            for _ in range(_TRIES * (self._count if begins else 1)):
                if len(self._riders) < self._count:
                    self._try_newcomer(roads, car_xy, FIRST_M if begins else UNSEEN_M)

    def _try_newcomer(self, roads: RoadsInForce, car_xy: Array, least_m: float) -> None:
        """Let somebody come at a place that is drawn, unless it is too near to others."""
        lanes = [lane for lane in roads.network.lanes.values() if lane.kind == "driving"]
        if not lanes:
            return
        rng = self._rng
        lengths = np.array([float(arc_lengths(lane.centerline)[-1]) for lane in lanes])
        lane = lanes[int(rng.choice(len(lanes), p=lengths / lengths.sum()))]
        kinds, shares = zip(*_SHARES, strict=True)
        kind: RoadUserKind = kinds[int(rng.choice(len(kinds), p=shares))]
        path = FrenetPath(lane.centerline)
        arc = float(rng.uniform(0.0, path.length_m))
        place = path.point_at(np.array([arc]))[0]
        others = [_place(rider) for rider in self._riders]
        away_m = float(np.hypot(*(place - car_xy)))
        near = any(float(np.hypot(*(place - other))) < APART_M for other in others)
        if near or not least_m <= away_m <= GONE_M:
            return
        name, traits = f"virtual-{self._named + 1}", KINDS[kind]
        share = float(manners([self._seed % 2**32], np.array([[key_of(name)]])).limit_share[0, 0])
        limit = np.full(len(lane.centerline), roads.network.limit_mps(lane.id))
        rider = Rider(
            name,
            kind,
            (traits.length_m, traits.width_m),
            share,
            lane.centerline,
            limit,
            lane.id,
            arc,
            0.0,
            path,
            (),
        )
        rider.lead_on(roads, _LONG_M, rng)
        if rider.left_m < _SHORT_M:
            return  # It would be gone at once.
        bend = square_bound(rider.path, decel_mps2=BEND_DECEL_MPS2)
        there = float(rider.path.at_nodes(np.sqrt(bend), np.array([rider.arc_m]))[0])
        rider.speed_mps = min(_wants(rider), there)
        self._named += 1
        self._riders.append(rider)
        self._stale = True

    def _cast_anew(self) -> None:
        """Take who drives where as it is now; who was there before goes on as it did."""
        self._stale = False
        path = self._car_path
        if not self._riders or path is None or self._roads is None:
            self._traffic = None
            return
        players = [
            Player(
                name=rider.name,
                kind=rider.kind,
                path=rider.path,
                start_arc_m=rider.arc_m,
                speed_mps=rider.speed_mps,
                desired_mps=_wants(rider),
                conduct="law_abiding",
                size_m=rider.size_m,
            )
            for rider in self._riders
        ]
        arrays = casting([players], ego_path=path, keys=[self._seed % 2**32])
        rules = self._roads.rules.between([self._car_taken, *(one.taken for one in self._riders)])
        traffic = Traffic(arrays.crowd, PathTable(arrays.paths), rules, arrays.paces)
        if self._traffic is not None:
            columns: Indices = np.array([self._columns.get(one.name, -1) for one in self._riders])
            shifts = np.array([rider.shifted_m for rider in self._riders])
            traffic.take_over(self._traffic, columns, shifts)
        self._entries.use(
            [
                Mover("", self._car_taken, self._size_m),
                *(Mover(one.name, one.taken, one.size_m) for one in self._riders),
            ]
        )
        for rider in self._riders:
            rider.shifted_m = 0.0
        self._traffic, self._rules = traffic, rules
        self._columns = {rider.name: column for column, rider in enumerate(self._riders)}


def _place(rider: Rider) -> Array:
    return np.asarray(rider.path.point_at(np.array([rider.arc_m]))[0])


def _wants(rider: Rider) -> float:
    """Return how fast a road user drives on a free road where it is."""
    limit = float(rider.path.at_nodes(rider.path.speed_limit_mps, np.array([rider.arc_m]))[0])
    traits = KINDS[rider.kind]
    wanted = (
        rider.limit_share * traits.limit_mps(limit) if np.isfinite(limit) else UNKNOWN_LIMIT_MPS
    )
    return min(wanted, traits.speed_mps)
