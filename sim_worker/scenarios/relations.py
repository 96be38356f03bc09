"""Who comes from where: the ways of other road users as the ego sees them at a junction."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
import shapely

from foretwin.contracts.arrays import Array
from foretwin.contracts.frames import wrap_angle
from foretwin.contracts.scenario import ActorPart, Relation, TrafficTurn
from foretwin.contracts.world import Crossing
from foretwin.geometry.frenet_path import FrenetPath
from foretwin.geometry.polyline import length
from foretwin.sim_worker.scenarios.roads import Passage, RoadNetwork
from foretwin.sim_worker.scenarios.ways import Way, whole_way

SIDE_RAD = (math.radians(30.0), math.radians(150.0))
"""Arms at these angles to the ego's own count as side arms."""
ONCOMING_RAD = math.radians(130.0)
WALKS_M = 60.0
"""How far a crossing's line is led on at either end."""
_CROSSING_AROUND_M = (12.0, 25.0)
"""How far inside the junction, and outside it, a mapped crossing counts as on that arm."""
_KERB_M, _CORNER_M = 1.2, 2.0
"""Who comes along the road does so at this distance from the kerb, and cuts the corner by this."""
_BEYOND_MOUTH_M = 4.0
"""Where no crossing is mapped, people cross so far from the junction."""

_JUNCTION_RELATIONS: tuple[Relation, ...] = ("oncoming", "from_near", "from_across")


def ways_of(actor: ActorPart, network: RoadNetwork, ego: Passage, ego_way: Way) -> Iterator[Way]:
    """Yield the ways by which an actor of this relation can meet an ego that takes `ego_way`.

    The likeliest come first. Nothing is yielded where the junction offers none; relations along
    the ego's own path have no way of their own.
    """
    if actor.relation in _JUNCTION_RELATIONS:
        yield from _over_the_junction(actor, network, ego)
    elif actor.relation == "on_ring":
        yield from _circulating(network, ego)
    elif actor.relation == "joins_ring":
        yield from _joining(network, ego)
    elif actor.relation in ("crosses_exit", "crosses_entry"):
        # Many scenarios ask for the same walks.
        key = (ego.name, actor.relation, actor.turn)
        if key not in network.walks:
            at_exit = actor.relation == "crosses_exit"
            network.walks[key] = tuple(_walking(actor.turn, network, ego_way, at_exit=at_exit))
        yield from network.walks[key]


def comes_from(relation: Relation, angle_rad: float, near_sign: float) -> float | None:
    """Return how far an arm lies from where a relation has it, or None where it is another.

    `angle_rad` is how far the other's heading is turned to the left of the ego's. Who comes
    from the right heads left.
    """
    if relation == "oncoming":
        return math.pi - abs(angle_rad) if abs(angle_rad) >= ONCOMING_RAD else None
    side = near_sign if relation == "from_near" else -near_sign
    turned = side * angle_rad
    return abs(turned - math.pi / 2) if SIDE_RAD[0] <= turned <= SIDE_RAD[1] else None


def _over_the_junction(actor: ActorPart, network: RoadNetwork, ego: Passage) -> Iterator[Way]:
    meets = {i for connection in ego.connections for i in connection.conflicts_with}
    found = []
    for order, other in enumerate(network.passages(ego.junction_id)):
        if other.turn != actor.turn or not meets & {c.id for c in other.connections}:
            continue
        angle = float(wrap_angle(other.entry_heading_rad - ego.entry_heading_rad))
        off = comes_from(actor.relation, angle, network.near_sign)
        if off is not None:
            found.append((off, order, other))
    for _, _, other in sorted(found, key=lambda item: item[:2]):
        yield network.way(other)


def _circulating(network: RoadNetwork, ego: Passage) -> Iterator[Way]:
    """Yield who comes round the ring; at a mini-roundabout who comes from the across side."""
    entering = ego.connections[0]
    if len(ego.connections) > 1 or network.lanes[entering.to_lane_id].role == "ring":
        way = network.way_round(entering)
        if way is not None:
            yield way
        return
    for turn in ("straight", "across", "near"):
        part = ActorPart(name="ring", relation="from_across", turn=turn)
        yield from _over_the_junction(part, network, ego)


def _joining(network: RoadNetwork, ego: Passage) -> Iterator[Way]:
    """Yield who enters the ring at a place that the ego passes on it."""
    meets = {i for connection in ego.connections[1:] for i in connection.conflicts_with}
    for other in network.passages(ego.junction_id):
        if other.connections[0].id in meets:
            yield network.way(other)


def _walking(
    turn: TrafficTurn, network: RoadNetwork, ego_way: Way, *, at_exit: bool
) -> Iterator[Way]:
    """Yield the lines across the arm that the ego leaves or enters by, in either direction."""
    inside, outside = _CROSSING_AROUND_M
    if at_exit:
        low, high = ego_way.exit_m - inside, ego_way.exit_m + outside
        mouth, farther_m = ego_way.exit_m + _BEYOND_MOUTH_M, _BEYOND_MOUTH_M
    else:
        low, high = ego_way.entry_m - outside, ego_way.entry_m + inside
        mouth, farther_m = ego_way.entry_m - _BEYOND_MOUTH_M, -_BEYOND_MOUTH_M
    mapped = _mapped(network.world.crossings, ego_way, low, high)
    nearest = sorted(mapped, key=lambda item: abs(item[0] - mouth))
    lines = {f"over {crossing.id}": crossing.line for _, crossing in nearest}
    # Where the mapped crossing does not do, people cross beside it.
    lines["beside the junction"] = _line_across(ego_way.path, mouth)
    lines["farther from the junction"] = _line_across(ego_way.path, mouth + farther_m)
    straight = [
        way
        for where, line in lines.items()
        for way in ways_over(line, turn, ego_way, network.near_sign, where=where)
    ]
    yield from straight
    away = 1.0 if at_exit else -1.0
    yield from (_along_the_road(way, ego_way, away) for way in straight)


def _mapped(
    crossings: tuple[Crossing, ...], ego_way: Way, low: float, high: float
) -> list[tuple[float, Crossing]]:
    """Return the crossings that the ego's path runs over between two arcs, and where."""
    arcs = np.arange(low, high + 0.5, 1.0)
    path = shapely.LineString(ego_way.path.point_at(arcs))
    found = []
    for crossing in crossings:
        line = shapely.LineString(crossing.line)
        if line.length > 1.0 and path.intersects(line):
            point = shapely.get_coordinates(path.intersection(line))[:1]
            found.append((low + float(path.project(shapely.Point(point[0]))), crossing))
    return found


def _line_across(path: FrenetPath, at_m: float) -> Array:
    pose = path.pose_at(np.array([at_m]))
    heading = float(pose.yaw_rad[0]) - math.pi / 2
    direction = np.array([math.cos(heading), math.sin(heading)])
    return np.asarray(pose.xy_m + np.array([[-3.0], [3.0]]) * direction)


def ways_over(
    line: Array, turn: TrafficTurn, ego_way: Way, near_sign: float, *, where: str
) -> Iterator[Way]:
    """Yield the way along a line (2, 2) over the ego's: to the across side, the near side, or both.

    `turn` names the side; `straight` stands for either. Names tell `where` it crosses.
    """
    middle = line.mean(axis=0)
    arc = float(ego_way.path.locate(middle[None]).arc_m[0])
    heading = float(ego_way.path.yaw_at(np.array([arc]))[0])
    step = line[1] - line[0]
    across_m = float(np.hypot(*step))
    direction = step / across_m
    left = float(direction @ np.array([-math.sin(heading), math.cos(heading)]))
    to_across = direction if left * near_sign > 0.0 else -direction
    directions = {"across": (to_across,), "near": (-to_across,)}
    for towards in directions.get(turn, (to_across, -to_across)):
        ends = middle + np.array([[-1.0], [1.0]]) * (across_m / 2 + WALKS_M) * towards
        side = "across" if towards is to_across else "near"
        yield _walk(f"on foot to the {side} side {where}", ends, WALKS_M, WALKS_M + across_m)


def _walk(name: str, xy_m: Array, entry_m: float, exit_m: float) -> Way:
    return whole_way(name, xy_m, entry_m, exit_m, limit_mps=math.inf)


def _along_the_road(way: Way, ego_way: Way, away: float) -> Way:
    """Return a walk that comes along the ego's road, from where `away` leads along the ego's way,
    and turns to cross: where walls stand at the crossing's end."""
    ends = way.path.point_at(np.array([way.entry_m - _KERB_M, way.exit_m]))
    kerb = ego_way.path.locate(ends[:1])
    arcs = kerb.arc_m + away * np.arange(WALKS_M, _CORNER_M, -_CORNER_M)
    xy = np.concatenate([ego_way.path.point_at(arcs, kerb.offset_m), ends, way.xy_m[-1:]])
    entry = length(xy[:-2]) + _KERB_M
    return _walk(f"{way.name}, along the road", xy, entry, entry + way.exit_m - way.entry_m)
