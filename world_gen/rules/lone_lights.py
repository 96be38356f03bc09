"""Lights that stand away from junctions, most of them for people on foot."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from foretwin.contracts.arrays import Array
from foretwin.contracts.provenance import Choice
from foretwin.contracts.signals import Signal, SignalGroup, SignalPhase, SignalPlan
from foretwin.contracts.world import Crossing, StopLine
from foretwin.geometry.polyline import length, locate, points_at
from foretwin.world_gen.lanes.clusters import Surroundings
from foretwin.world_gen.lanes.lane_curves import LaneDraft, LaneSet
from foretwin.world_gen.lanes.stopping import (
    BEFORE_CROSSING_M,
    CROSSING_NEAR_M,
    NodeTags,
    clear_of_crossings,
    faces,
)
from foretwin.world_gen.lanes.tapers import MAX_TRIM_M
from foretwin.world_gen.roads.road_tags import is_crossed
from foretwin.world_gen.rules.control_devices import is_light
from foretwin.world_gen.rules.signal_heads import (
    BESIDE_HEIGHT_M,
    beside,
    nearest_kerb,
    to_kerb_m,
    towards_drivers_rad,
)
from foretwin.world_gen.rules.stop_lines import lines_across, most_back_m

DRIVING_S, WALKING_S = 40.0, 10.0
AMBER_S, ALL_RED_S = 3.0, 2.0
_REACH_M = 9.0
"""Lanes end up to this far from a node where they change their number."""
_PAST_M = 1.0
"""A lane that keeps to its place beside a crossing's node, but for so much, leads over it."""


class LoneLights(NamedTuple):
    """Stop lines, heads and plans of the lights away from junctions."""

    stop_lines: tuple[StopLine, ...]
    signals: tuple[Signal, ...]
    plans: tuple[SignalPlan, ...]


def lone_lights(
    around: Surroundings,
    node_tags: NodeTags,
    lanes: LaneSet,
    crossings: Sequence[Crossing],
    known: Collection[int],
    *,
    red_amber_s: float = 0.0,
) -> LoneLights:
    """Return what governs the lanes at each light that belongs to no junction.

    `known` are the map's nodes of the lights at junctions.
    A light without a tagged direction stops both; its plan lets cars drive
    for most of the time, and those on foot after them.
    """
    taken = set(known)
    inner: set[int] = set()
    for cluster in around.clusters:
        inner |= cluster.inner
        if cluster.junction is not None:
            taken |= cluster.junction.lights | cluster.junction.nodes
    on_edge: dict[int, list[LaneDraft]] = {}
    for lane in lanes.lanes.values():
        on_edge.setdefault(lane.key.edge, []).append(lane)
    places: dict[int, list[tuple[int, int]]] = {}
    for index, edge in sorted(around.edges.items()):
        if index not in inner:
            for i, node in enumerate(edge.node_ids):
                if node not in taken and is_light(node_tags.get(node, {})):
                    places.setdefault(node, []).append((index, i))
    by_node = {c.osm_node: c for c in crossings}
    walked = {
        index: [edge.xy_m[i] for i, node in enumerate(edge.node_ids) if node in by_node]
        for index, edge in around.edges.items()
    }
    before = lanes.before
    lines: list[StopLine] = []
    heads: list[Signal] = []
    plans: list[SignalPlan] = []
    for node, found in sorted(places.items()):
        stopped = []
        for index, i in found:
            for lane in on_edge.get(index, ()):
                if faces(node_tags[node], not lane.key.reverse) is not False:
                    on_way = 0 < i < len(around.edges[index].node_ids) - 1
                    at_xy = around.edges[index].xy_m[i]
                    place = _LightPlace(node, at_xy, node_tags[node], on_way, walked[index])
                    line = _line(lane, place, before)
                    if line is not None:
                        stopped.append((lane, line))
        if not stopped:
            continue
        lines.extend(line for _, line in stopped)
        heads.extend(_heads(stopped, node, around))
        plans.append(_plan(node, by_node.get(node), red_amber_s))
    return LoneLights(tuple(lines), tuple(heads), tuple(plans))


class _LightPlace(NamedTuple):
    """Where a light stands on an edge, between its ends or at one, and the crossings there."""

    node: int
    xy: Array
    tags: Mapping[str, str]
    on_way: bool
    walked: Sequence[Array]


def _line(lane: LaneDraft, light: _LightPlace, before: Mapping[str, LaneDraft]) -> StopLine | None:
    """Return the line of a light; None where the lane does not come past it.

    Between the ends of an edge a lane may begin behind it, where a junction took the room: the line
    is at its beginning. Where it stands at a fork, whose turns take room as well, it is at the
    lane's end. Cars wait before a crossing that they would block, and before any near one where the
    light faces both ways, as it stands in the middle of what it is for.
    """
    at_m, ends_m = locate(lane.centerline, light.xy), length(lane.centerline)
    cut = at_m <= 0.5
    reach = abs(lane.plan.left_m) + (MAX_TRIM_M if cut or at_m >= ends_m - 0.5 else _REACH_M)
    if (cut and not light.on_way) or _aside_m(lane, at_m, light.xy) > reach:
        return None
    own = is_crossed(light.tags)
    served_m = 0.0 if own or faces(light.tags, True) is not None else CROSSING_NEAR_M
    met = ((locate(lane.centerline, xy), xy) for xy in light.walked)
    back_m = clear_of_crossings(
        ends_m - at_m + (BEFORE_CROSSING_M if own else 0.0),
        [ends_m - m for m, xy in met if _aside_m(lane, m, xy) < abs(lane.plan.left_m) + _PAST_M],
        served_m=ends_m - at_m + served_m,
        most_m=most_back_m(lane, before),
    )
    name, control = f"light{light.node}", Choice("signal", "tagged")
    (line,) = lines_across([(lane, back_m, control)], before, name)
    return line


def _aside_m(lane: LaneDraft, at_m: float, xy: Array) -> float:
    return math.hypot(*(points_at(lane.centerline, at_m) - xy))


def _heads(
    stopped: list[tuple[LaneDraft, StopLine]], node: int, around: Surroundings
) -> list[Signal]:
    """Return a head beside the outermost lane of each direction of each road."""
    roads: dict[tuple[str, bool], list[tuple[LaneDraft, StopLine]]] = {}
    for lane, line in stopped:
        roads.setdefault((lane.road_id, lane.key.reverse), []).append((lane, line))
    heads = []
    for mine in roads.values():
        outermost = nearest_kerb([lane for lane, _ in mine], around.driving_side)
        lane, line = next(item for item in mine if item[0] is outermost)
        place = beside(line.ends, to_kerb_m(lane, around), around.driving_side)
        heads.append(
            Signal(
                id=f"{lane.id}:light{node}",
                osm_node=node,
                group_id=group_names(node)[0],
                lane_ids=tuple(item.id for item, _ in mine),
                position=np.round(np.array([place[0], place[1], BESIDE_HEIGHT_M]), 3),
                yaw_rad=towards_drivers_rad(line.ends),
                source="tagged",
                osm_nodes=(node,),
            )
        )
    return heads


def group_names(node: int) -> tuple[str, str]:
    """Return the ids of a lone light's groups: of those who drive, and of those on foot."""
    return f"n{node}:g0", f"n{node}:g1"


def _plan(node: int, crossing: Crossing | None, red_amber_s: float) -> SignalPlan:
    drive_id, walk_id = group_names(node)
    drive = SignalGroup(id=drive_id, connection_ids=())
    crossed = () if crossing is None else (crossing.id,)
    walk = SignalGroup(id=walk_id, connection_ids=(), crossing_ids=crossed)
    return SignalPlan(
        groups=(drive, walk) if crossed else (drive,),
        phases=(
            SignalPhase(green_s=DRIVING_S, green_group_ids=(drive.id,)),
            SignalPhase(green_s=WALKING_S, green_group_ids=(walk.id,) if crossed else ()),
        ),
        amber_s=AMBER_S,
        all_red_s=ALL_RED_S,
        red_amber_s=red_amber_s,
        source="default",
    )
