"""Places away from junctions: motorways, open roads, race tracks, and bays beside a road."""

from __future__ import annotations

import collections
import math
from collections.abc import Iterator, Sequence

import numpy as np
import shapely

from foretwin.contracts.arrays import Array
from foretwin.contracts.frames import wrap_angle
from foretwin.contracts.scenario import Scenario
from foretwin.contracts.world import Lane
from foretwin.geometry.frenet_path import FrenetPath
from foretwin.geometry.polyline import arc_lengths, length, points_at
from foretwin.sim_worker.scenarios.places import ScenarioPlace
from foretwin.sim_worker.scenarios.relations import ways_over
from foretwin.sim_worker.scenarios.roads import RoadNetwork
from foretwin.sim_worker.scenarios.ways import APPROACH_M, DEPARTURE_M, Way, whole_way

_CLASSES = {"motorway": ("motorway", "trunk"), "circuit": ("raceway",)}
_FAST = ("motorway", "trunk", "motorway_link", "trunk_link", "raceway")
_LEAST_M = {"motorway": 120.0, "road": 60.0, "circuit": 150.0, "parking_bay": 32.0}
_LEAST_RADIUS_M = 150.0
"""Of a motorway's lane: a bend for 80 km/h, at 0.34 g. Trunk roads through junctions bend more."""
_JOINT_M = 1.5

_BAY_RADIUS_M = 6.0
"""Of the rear axle's path: a compact car turns within 10.5 to 11 m from kerb to kerb."""
_BAY_WIDTH_M = 2.2
_BACKS_STRAIGHT_M = 24.0
_BAY_LENGTH_M = 6.0
_BEND_RAD = math.radians(6.0)


def other_places(scenario: Scenario, network: RoadNetwork) -> tuple[Iterator[ScenarioPlace], str]:
    """Return the places of a scenario that needs no junction, and why there is none if so."""
    setting = scenario.where.setting
    if setting == "parking_bay":
        return _bays(scenario, network)
    lanes = [lane for lane in network.world.lanes if _fits(lane, setting, network)]
    if not lanes:
        return iter(()), f"no {_WORDS[setting]} in the World"
    ways = _laps(network, lanes) if setting == "circuit" else _stretches(network, lanes)
    fitting = (
        way
        for way in ways
        if way.last_m - way.first_m >= _LEAST_M[setting]
        and (setting != "motorway" or _least_radius_m(way) >= _LEAST_RADIUS_M)
    )
    none = [()] * len(scenario.actors)
    places = (place_in(network, scenario, way.name, way, none) for way in fitting)
    why = f"each {_WORDS[setting]} is shorter than {_LEAST_M[setting]:g} m"
    if setting == "motorway":
        why += f" or has a bend tighter than {_LEAST_RADIUS_M:g} m"
    return places, why


_WORDS = {
    "motorway": "motorway or trunk road with a second lane to overtake on",
    "road": "road for cars",
    "circuit": "race track",
}


def _fits(lane: Lane, setting: str, network: RoadNetwork) -> bool:
    if lane.kind != "driving" or lane.role == "ring":
        return False
    road = network.roads.get(lane.road_id)
    road_class = "" if road is None else road.road_class
    if setting == "motorway":
        across = network.beside(lane, near=False)
        return road_class in _CLASSES["motorway"] and across is not None
    return setting != "circuit" or road_class in _CLASSES["circuit"]


def _least_radius_m(way: Way) -> float:
    """Return the radius of a way's tightest bend, as far as lanes carry it."""
    arcs = np.arange(way.first_m, way.last_m, 1.0)
    curvature = way.path.at_nodes(way.path.curvature_pm, arcs)
    return 1.0 / max(float(np.abs(curvature).max()), 1e-6)


def place_in(
    network: RoadNetwork,
    scenario: Scenario,
    name: str,
    ego: Way,
    actor_ways: Sequence[tuple[Way, ...]],
) -> ScenarioPlace:
    """Return a place of a scenario in a World, at its own junction or road."""
    return ScenarioPlace(
        scenario_id=scenario.id,
        junction_id=network.world.intersection.id,
        name=name,
        driving_side=network.driving_side,
        ego=ego,
        actor_ways=tuple(actor_ways),
        walls=network.walls,
    )


def _stretches(network: RoadNetwork, lanes: list[Lane]) -> Iterator[Way]:
    """Yield the way along each lane, the longest lanes first, to be driven up to its end."""
    order = sorted(lanes, key=lambda lane: (-length(lane.centerline), lane.id))
    for lane in order:
        way = network.lane_way(lane)
        yield way._replace(entry_m=max(way.entry_m, way.last_m - DEPARTURE_M))


def _laps(network: RoadNetwork, lanes: list[Lane]) -> Iterator[Way]:
    """Yield the way along each race track: round once and on, or as far as the World has it.

    Of a track on which nothing else meets, the map does not say where it begins: lanes whose ends
    lie at another's start go on there, connected or not.
    """
    left = {lane.id: lane for lane in sorted(lanes, key=lambda lane: lane.id)}
    onward = {id_: _onward(left[id_], left, network) for id_ in left}
    before = {then[-1]: id_ for id_, then in onward.items() if then}
    while left:
        first = start = next(iter(left))
        while before.get(first) in left and before[first] != start:
            first = before[first]
        chain, lane_id = [first], first
        while (then := onward[lane_id]) and then[-1] != first and then[-1] in left:
            left.pop(lane_id)
            chain.extend(then)
            lane_id = then[-1]
        closed = bool(then) and then[-1] == first
        left.pop(lane_id)
        after = [*then[:-1], *chain] if closed else []
        name = f"{'lap' if closed else 'part of a lap'} from {first}"
        way = network.way_along(name, before=[], middle=chain, after=after)
        entry = way.first_m + min(APPROACH_M, (way.last_m - way.first_m) / 2.0)
        yield way._replace(entry_m=max(entry, APPROACH_M))


def _onward(lane: Lane, among: dict[str, Lane], network: RoadNetwork) -> list[str]:
    """Return what follows on a lane: the next lane, last, and the connection to it, if any."""
    for after in network.after(lane.id):
        if after in among:
            return [after]
        for then in network.after(after):
            if then in among:
                return [after, then]
    end = lane.centerline[-1]
    apart = {id_: float(np.hypot(*(other.centerline[0] - end))) for id_, other in among.items()}
    nearest = min(apart, key=lambda id_: apart[id_])
    return [nearest] if apart[nearest] <= _JOINT_M else []


def _bays(scenario: Scenario, network: RoadNetwork) -> tuple[Iterator[ScenarioPlace], str]:
    """Return a bay at the near side of each lane that is straight, long and clear enough."""
    reasons = {lane.id: _no_bay(lane, network) for lane in network.world.lanes}
    fitting = [lane for lane in network.world.lanes if not reasons[lane.id]]
    counted = collections.Counter(reason for reason in reasons.values() if reason)
    why = counted.most_common(1)[0][0] if counted else "there is none"
    if fitting:
        why = "buildings stand beside those that are long enough"
    bays = (_Bay(lane, network) for lane in fitting)
    clear = (bay for bay in bays if not network.walls.meet(bay.box))
    places = (bay.place(scenario, network) for bay in clear)
    return places, f"no lane has room for a bay beside it: {why}"


def _no_bay(lane: Lane, network: RoadNetwork) -> str:
    road = network.roads.get(lane.road_id)
    if lane.kind != "driving" or lane.role == "ring":
        return "none is for cars"
    if road is not None and road.road_class in _FAST:
        return "nobody parks at fast roads"
    if network.beside(lane, near=True) is not None:
        return "another lane lies between"
    half = _LEAST_M["parking_bay"] / 2.0
    middle = length(lane.centerline) / 2.0
    if middle < half:
        return f"shorter than {_LEAST_M['parking_bay']:g} m"
    steps = np.diff(points_at(lane.centerline, middle + np.linspace(-half, half, 9)), axis=0)
    turn = wrap_angle(np.diff(np.arctan2(steps[:, 1], steps[:, 0])))
    return "not straight" if float(np.abs(np.cumsum(turn)).max()) > _BEND_RAD else ""


class _Bay:
    """A parking bay beside the middle of a lane, and the way backwards into it.

    Two arcs of one radius lead from the lane's middle to that of the bay, a shift of
    2 R (1 - cos φ) over a length of 2 R sin φ.
    """

    def __init__(self, lane: Lane, network: RoadNetwork) -> None:
        self._lane = lane
        self._path = FrenetPath(lane.centerline, before_m=60.0)
        self._limit_mps = float(lane.speed_limit_mps.value)
        self._to_near = -network.near_sign
        self.shift_m = max(float(lane.width_m.value) / 2.0, 1.3) + _BAY_WIDTH_M / 2.0
        self._angle_rad = math.acos(1.0 - self.shift_m / (2.0 * _BAY_RADIUS_M))
        self.reach_m = 2.0 * _BAY_RADIUS_M * math.sin(self._angle_rad)
        self._middle_m = length(lane.centerline) / 2.0
        ends = self._middle_m + _BAY_LENGTH_M / 2.0 * np.array([-1.0, 1.0])
        half = _BAY_WIDTH_M / 2.0
        sides = self._to_near * (self.shift_m + half * np.array([-1.0, 1.0]))
        corners = [(0, 0), (1, 0), (1, 1), (0, 1)]
        self.box = shapely.Polygon([self._at(ends[i], sides[j])[0] for i, j in corners])

    def _at(self, arc_m: Array | float, left_m: Array | float) -> Array:
        arc, left = np.broadcast_arrays(np.atleast_1d(arc_m), np.atleast_1d(left_m))
        return self._path.point_at(arc, left)

    def place(self, scenario: Scenario, network: RoadNetwork) -> ScenarioPlace:
        """Return the place: base_link backs along the ego's way to a metre behind the middle."""
        stop_m = self._middle_m - 1.3
        turn = np.linspace(0.0, self._angle_rad, 9)
        along = _BAY_RADIUS_M * np.sin(turn)
        aside = _BAY_RADIUS_M * (1.0 - np.cos(turn))
        # From where it stands in the lane to the bay; the second arc is the first one turned.
        back = np.concatenate([along, (self.reach_m - along[::-1])[1:]])
        side = np.concatenate([aside, (self.shift_m - aside[::-1])[1:]])
        start_m = stop_m + self.reach_m
        xy = np.concatenate(
            [
                self._at(start_m + np.array([_BACKS_STRAIGHT_M, _BACKS_STRAIGHT_M / 2.0]), 0.0),
                self._at(start_m - back, self._to_near * side),
            ]
        )
        arc = arc_lengths(xy)
        name, limit_mps = f"into a bay at {self._lane.id}", self._limit_mps
        ego = whole_way(name, xy, float(arc[2]), float(arc[-1]), limit_mps=limit_mps)
        line = self._at(self._middle_m + np.array([-20.0, 0.0, 20.0]), self._to_near * self.shift_m)
        bay = whole_way("in the bays beside it", line, 20.0, 20.0, limit_mps=limit_mps)
        across = self._at(self._middle_m, self._to_near * np.array([-1.0, self.shift_m + 2.0]))
        ways = tuple(
            tuple(ways_over(across, "straight", ego, network.near_sign, where="behind the bay"))
            if part.relation == "crosses_exit"
            else (bay,)
            for part in scenario.actors
        )
        return place_in(network, scenario, name, ego, ways)._replace(reverse=True)
