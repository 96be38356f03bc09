"""One case as it was played, judged from its result and the raw map: was it playable, and why not?

Poses come from the trajectory and the tracks of the result; buildings and limits from the map's
file. What foretwin thinks of the place is not asked.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import shapely

from foretwin.contracts.futures import FuturesResult
from foretwin.contracts.scenario import Scenario
from foretwin.contracts.vehicle import VehicleParameters
from foretwin.sim_worker.scenarios.roles import StagedCase
from tests.placed.raw_map import Plane, RawMap, RawRoad

NEAR_M = 0.1
"""From a promised impact to the promised point."""
OVER_LIMIT = 1.1
"""An ego that is to be an ordinary driver's is no faster, by the limit that the map tags."""
LEAST_RUN_UP_S = 2.5
"""Before an impact: perception and reaction of a driver (AASHTO Green Book, 2018, 3.2.2)."""
_SHRUNK_M = 0.3
"""Outlines of buildings are drawn no better: who is so much within one is in it."""
_SHARED_ARC_M, _LEAST_ANGLE_RAD = 3.0, math.radians(20.0)
_SIDES = {"straight": 0, "across": 1, "near": -1}
_ARMS = {"from_near": 1, "oncoming": 2, "from_across": -1}


class Around(NamedTuple):
    """The raw map around one World's origin, in its metres."""

    buildings: shapely.STRtree
    roads: tuple[RawRoad, ...]
    lines: shapely.STRtree

    @classmethod
    def of(cls, raw: RawMap, lat_deg: float, lon_deg: float) -> Around:
        """Return what lies about within some hundred metres of a place."""
        plane, reach = Plane(lat_deg, lon_deg), 0.004
        here = shapely.box(
            lon_deg - 2 * reach, lat_deg - reach, lon_deg + 2 * reach, lat_deg + reach
        )
        near = [b for b in raw.buildings if b.intersects(here)]
        roads = [r for r in raw.roads if shapely.LineString(r.lon_lat).intersects(here)]
        lines = [shapely.LineString(plane.xy_m(r.lon_lat)) for r in roads]
        passages = shapely.union_all(
            [line.buffer(4.0) for r, line in zip(roads, lines, strict=True) if r.below_buildings]
        )
        buildings = [plane.of(b).buffer(-_SHRUNK_M).difference(passages) for b in near]
        return cls(shapely.STRtree(buildings), tuple(roads), shapely.STRtree(lines))


class Verdict(NamedTuple):
    """What became of a placed case: whether an impact was promised and came where it was, and all
    that speaks against it; playable where nothing does."""

    promised: bool
    off_m: float
    against: tuple[str, ...]


def judged(
    scenario: Scenario,
    case: StagedCase,
    result: FuturesResult,
    row: int,
    vehicle: VehicleParameters,
    around: Around,
) -> Verdict:
    """Judge a future of a result, in which a case that was placed was played."""
    meant, faulty = case.impact_with, _steers_badly(case.values)
    states, poses = result.trajectory.states[row], result.road_users.poses[row]
    time_s, against = result.trajectory.time_s, []
    hits = {a.future: a for a in result.accidents}
    hit, off_m, end_s = hits.get(row), math.nan, float(scenario.horizon_s)
    if not result.outcome.valid[row]:
        against.append("the drive fails")
    if meant:
        promised = result.planned is not None and result.planned.met[row] == meant
        if not promised:
            against.append("played, no impact is promised any more")
        elif hit is None or not np.isfinite(off_m := float(result.planned.off_m[row])):
            against.append("the impact does not come")
        elif off_m > NEAR_M:
            against.append("the impact is farther than 0.1 m from its point")
        if hit is not None:
            end_s = hit.time_s
            if end_s < LEAST_RUN_UP_S:
                against.append(f"less than {LEAST_RUN_UP_S} s of run-up")
    elif result.outcome.collided[row] and result.outcome.collision_time_s[row] < 0.5:
        against.append("it begins with a collision")
    if result.outcome.collided[row] and result.outcome.collision_with[row] == 2 and not faulty:
        against.append("the ego drives into a building or island")
    until = time_s <= end_s + 1e-6
    ego, others = _ego_boxes(states[until], vehicle), _other_boxes(result, row, until)
    for who, boxes in (("the ego", ego), *(("another", other) for other in others)):
        inside = [len(around.buildings.query(box, "intersects")) > 0 for box in boxes]
        if inside and inside[0]:
            against.append(f"{who} begins in a building of the map")
        elif any(inside) and not (faulty and boxes is ego):
            against.append(f"{who} goes through a building of the map")
    if not scenario.ego.reverse:
        against += _wrong_road(case.ego_speed_mps, states[0], scenario, around)
    against += _no_crossing(scenario, meant, states, poses, until)
    return Verdict(bool(meant), off_m, tuple(dict.fromkeys(against)))


def _steers_badly(values: dict[str, float]) -> bool:
    """Return whether a case is one of an ego that leaves its way: its fault, not the place's."""
    neutral = {"faults.steering_gain": 1.0, "faults.steering_offset_rad": 0.0}
    neutral["faults.position_offset_m"] = 0.0
    return any(values[name] != value for name, value in neutral.items())


def _ego_boxes(states: np.ndarray, vehicle: VehicleParameters) -> list[shapely.Polygon]:
    rear, width = vehicle.rear_overhang_m.value, vehicle.width_m.value
    front = vehicle.length_m.value - rear
    return [_box(x, y, yaw, -rear, front, width) for x, y, yaw in states[:, :3]]


def _other_boxes(result: FuturesResult, row: int, until: np.ndarray) -> list[list[shapely.Polygon]]:
    sizes = result.road_users.size_m[row]
    tracks = np.moveaxis(result.road_users.poses[row][until], 1, 0)
    return [
        [_box(*pose, -length / 2, length / 2, width) for pose in track if np.isfinite(pose).all()]
        for track, (length, width) in zip(tracks, sizes, strict=True)
    ]


def _box(
    x: float, y: float, yaw: float, back: float, front: float, width: float
) -> shapely.Polygon:
    along = np.array([math.cos(yaw), math.sin(yaw)])
    left = np.array([-along[1], along[0]]) * width / 2
    at = np.array([x, y])
    return shapely.Polygon(
        [at + back * along + left, at + back * along - left, at + front * along - left,
         at + front * along + left]
    )  # fmt: skip


def _wrong_road(
    speed_mps: float, start: np.ndarray, scenario: Scenario, around: Around
) -> list[str]:
    """Return what is wrong with the road below the ego's start, by its tags."""
    along = np.array([math.cos(start[2]), math.sin(start[2])])
    here = shapely.LineString([start[:2], start[:2] + 8.0 * along])
    near = around.lines.query(here, "dwithin", 12.0)
    if not len(near):
        return ["the ego begins on no road of the map"]
    alike = [i for i in near if _alike(around.lines.geometries[i], here)]
    if not alike:
        return []  # Within a junction, on its way from one road to another.
    road = around.roads[min(alike, key=lambda i: around.lines.geometries[i].distance(here))]
    wrong, limit = [], road.tagged_mps
    if limit is not None and speed_mps > OVER_LIMIT * limit + 0.1:
        wrong.append("the ego is faster than the road's tagged limit")
    kinds = {a.kind for a in scenario.actors} | {a.relation for a in scenario.actors}
    if kinds & {"pedestrian", "bicycle", "parked"} and road.tags["highway"] in (
        "motorway",
        "motorway_link",
    ):
        wrong.append("people on foot, bicycles or parked cars on a motorway")
    return wrong


def _alike(line: shapely.LineString, here: shapely.LineString) -> bool:
    """Return whether a line runs as another one, either way, where it is nearest."""
    at = line.project(here.centroid)
    a, b = (line.interpolate(at + step) for step in (-2.0, 2.0))
    (x0, y0), (x1, y1) = here.coords[0], here.coords[-1]
    turned = math.atan2(b.y - a.y, b.x - a.x) - math.atan2(y1 - y0, x1 - x0)
    return abs(math.sin(turned)) < math.sin(math.radians(35.0))


def crosses(scenario: Scenario, name: str) -> bool:
    """Return whether the ways of the ego and another lead to different arms: whether they cross.

    Arms and turns count as quarters to the left where traffic keeps right.
    """
    other = next((a for a in scenario.actors if a.name == name), None)
    if other is None or other.relation not in _ARMS:
        return False
    ego_leaves = _SIDES[scenario.ego.turn]
    return (_ARMS[other.relation] + _SIDES[other.turn] - ego_leaves) % 4 != 0


def _no_crossing(
    scenario: Scenario, meant: str, states: np.ndarray, poses: np.ndarray, until: np.ndarray
) -> list[str]:
    """Return what is wrong where two cars are to cross: a merge, or nearly one way."""
    if not meant or not crosses(scenario, meant):
        return []
    which = [a.name for a in scenario.actors].index(meant)
    last = int(until.sum()) - 1
    turned = abs(math.remainder(float(poses[last, which, 2] - states[last, 2]), math.tau))
    if turned < _LEAST_ANGLE_RAD:
        return ["the two meet at less than 20°: a merge"]
    both_straight = scenario.ego.turn == scenario.actors[which].turn == "straight"
    if both_straight and not math.pi / 4 <= turned <= 3 * math.pi / 4:
        return ["both go straight on, and do not meet across"]
    return []
