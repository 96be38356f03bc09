"""Lanes as curves in the World's frame, cut where junctions begin."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal, NamedTuple

import numpy as np

from contracts.arrays import Array
from contracts.world import Lane, LaneKind, Quantity, Turn
from world_gen.clusters import Cluster, Surroundings
from world_gen.cross_section import LanePlan
from world_gen.polyline import arc_lengths, cut, inside_disc, offset, rounded, unit, without_repeats
from world_gen.road_graph import DirectedEdge, RoadEdge

Role = Literal["approach", "exit", "ring", "other"]
MIN_LANE_M = 0.05


class LaneKey(NamedTuple):
    """A lane before it is cut to the World: edge index, direction, number from the left."""

    edge: int
    reverse: bool
    number: int


@dataclass(slots=True)
class LaneDraft:
    """A lane while the World is being built."""

    id: str
    key: LaneKey
    edge: RoadEdge
    plan: LanePlan
    centerline: Array
    role: Role
    turns: tuple[Turn, ...]
    left_id: str | None = None
    right_id: str | None = None
    successors: list[str] = field(default_factory=list)

    @property
    def kind(self) -> LaneKind:
        """What the lane is for."""
        return self.plan.kind

    @property
    def width_m(self) -> Quantity:
        """Width in metres."""
        return self.plan.width_m

    def finished(self) -> Lane:
        """Return the lane as the World holds it."""
        return Lane(
            id=self.id,
            osm_way=self.edge.way_id,
            name=self.edge.name,
            kind=self.kind,
            centerline=self.centerline,
            width_m=self.width_m,
            speed_limit_mps=self.edge.speed_limit_mps,
            role=self.role,
            turns=self.turns,
            turns_source=self.plan.turns_source,
            direction_source=self.plan.direction_source,
            left_id=self.left_id,
            right_id=self.right_id,
            successor_ids=tuple(sorted(set(self.successors))),
        )


@dataclass(frozen=True, slots=True)
class LaneSet:
    """All lanes of a World; `begins` and `ends` hold those not cut off by the World's edge."""

    lanes: Mapping[str, LaneDraft]
    begins: Mapping[LaneKey, str]
    ends: Mapping[LaneKey, str]
    notes: tuple[str, ...]

    def incoming(self, toward: DirectedEdge, plans: tuple[LanePlan, ...]) -> list[LaneDraft]:
        """Return the lanes that end where `toward` ends, from the left."""
        keys = [LaneKey(toward.edge.index, toward.reverse, p.number) for p in plans]
        return [self.lanes[self.ends[k]] for k in keys if k in self.ends]

    def outgoing(self, away: DirectedEdge, plans: tuple[LanePlan, ...]) -> list[LaneDraft]:
        """Return the lanes that begin where `away` begins, from the left."""
        keys = [LaneKey(away.edge.index, away.reverse, p.number) for p in plans]
        return [self.lanes[self.begins[k]] for k in keys if k in self.begins]


def build_lanes(around: Surroundings) -> LaneSet:
    """Return every car lane within the World's radius, joined to lanes that simply go on."""
    lanes: dict[str, LaneDraft] = {}
    begins: dict[LaneKey, str] = {}
    ends: dict[LaneKey, str] = {}
    notes: list[str] = []
    inner = frozenset().union(*(c.inner for c in around.clusters))
    roles = _roles(around)
    continuing = _directions_beyond(around)
    for index, edge in sorted(around.edges.items()):
        if index in inner:
            continue
        section = around.sections[index]
        notes.extend(section.notes)
        start = around.trims_m.get((index, False), 0.0)
        stop = around.trims_m.get((index, True), 0.0)
        way = without_repeats(edge.xy_m)
        total = float(arc_lengths(way)[-1])
        if total - start - stop < MIN_LANE_M:
            notes.append(f"way {edge.way_id}: {total:.1f} m between junctions, too short for lanes")
            continue
        way = rounded(cut(way, start, total - stop))
        before = continuing.get((index, False)) if start == 0.0 else None
        after = continuing.get((index, True)) if stop == 0.0 else None
        for plan in section.lanes:
            key = LaneKey(index, plan.reverse, plan.number)
            curve = offset(way, plan.left_m, before=before, after=after)
            curve = curve[::-1] if plan.reverse else curve
            pieces = inside_disc(curve, around.radius_m)
            for i, piece in enumerate(pieces):
                points = np.round(without_repeats(piece), 3)
                if len(points) < 2:
                    continue
                name = _lane_id(edge, plan, i, lanes)
                role = roles.get((index, plan.reverse), "other")
                lanes[name] = LaneDraft(name, key, edge, plan, points, role, plan.turns)
                if np.array_equal(piece[0], curve[0]):
                    begins[key] = name
                if np.array_equal(piece[-1], curve[-1]):
                    ends[key] = name
    found = LaneSet(lanes, begins, ends, tuple(notes))
    _join_neighbours(found)
    return found


def _lane_id(edge: RoadEdge, plan: LanePlan, piece: int, taken: Mapping[str, LaneDraft]) -> str:
    way = "b" if plan.reverse else "f"
    name = f"w{edge.way_id}.{edge.start_node}.{edge.end_node}.{way}{plan.number}"
    name = name if piece == 0 else f"{name}.{piece}"
    twin = 2
    while name in taken:
        name, twin = f"{name.split('#')[0]}#{twin}", twin + 1
    return name


def _roles(around: Surroundings) -> dict[tuple[int, bool], Role]:
    """Return the role of lanes by (edge index, reverse)."""
    roles: dict[tuple[int, bool], Role] = {}
    on_ring = {n for c in around.clusters if c.main and c.ring for n in c.nodes}
    inner = set(around.junction.inner)
    for cluster in around.clusters:
        if not cluster.main:
            continue
        for leg in cluster.legs:
            index = leg.edge.index
            if index in around.ring_edges:
                roles[index, leg.reverse] = roles[index, not leg.reverse] = "ring"
                continue
            if index in inner and on_ring and leg.start_node not in on_ring:
                continue  # the short leg between ring and parting point: its ring end decides
            roles[index, leg.reverse] = roles.get((index, leg.reverse), "exit")
            roles[index, not leg.reverse] = "approach"
    return roles


def _directions_beyond(around: Surroundings) -> dict[tuple[int, bool], Array]:
    """Return, where a road merely goes on, its direction beyond each end (along the nodes)."""
    beyond: dict[tuple[int, bool], Array] = {}
    for cluster in around.clusters:
        if not cluster.plain or any(
            around.trims_m[leg.edge.index, leg.reverse] for leg in cluster.legs
        ):
            continue
        for leg, other in (cluster.legs, cluster.legs[::-1]):
            xy = without_repeats(other.xy_m)
            away = unit(xy[1] - xy[0])
            # Along the nodes: into this edge's start from the other, or on from its end.
            beyond[leg.edge.index, leg.reverse] = away if leg.reverse else -away
    return beyond


def _join_neighbours(lanes: LaneSet) -> None:
    of_key: dict[LaneKey, list[LaneDraft]] = {}
    for lane in lanes.lanes.values():
        of_key.setdefault(lane.key, []).append(lane)
    for key, pieces in of_key.items():
        right = of_key.get(key._replace(number=key.number + 1), [])
        if len(right) == len(pieces):
            for mine, other in zip(pieces, right, strict=True):
                mine.right_id, other.left_id = other.id, mine.id


def join_straight_on(cluster: Cluster, around: Surroundings, lanes: LaneSet) -> bool:
    """Join lanes that meet exactly where one road goes on; false where they do not."""
    if not cluster.plain or any(
        around.trims_m[leg.edge.index, leg.reverse] for leg in cluster.legs
    ):
        return False
    for leg, other in (cluster.legs, cluster.legs[::-1]):
        toward = DirectedEdge(leg.edge, not leg.reverse)
        arriving = lanes.incoming(toward, around.section(leg).driven(reverse=toward.reverse))
        leaving = lanes.outgoing(other, around.section(other).driven(reverse=other.reverse))
        for a, b in zip(arriving, leaving, strict=False):
            a.successors.append(b.id)
    return True
