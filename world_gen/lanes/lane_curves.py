"""Lanes as curves in the World's frame, cut where junctions begin."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from typing import Literal, NamedTuple

import msgspec
import numpy as np

from foretwin.contracts.arrays import Array
from foretwin.contracts.provenance import PlaceSource, Provenance, Quantity
from foretwin.contracts.world import Lane, LaneKind, Road, Turn
from foretwin.geometry.polyline_batch import Polylines, offset, without_repeats
from foretwin.world_gen.lanes.cluster import Cluster
from foretwin.world_gen.lanes.clusters import Surroundings
from foretwin.world_gen.lanes.lane_plans import CrossSection, LanePlan
from foretwin.world_gen.lanes.places import places_led_through, without_dead_places
from foretwin.world_gen.lanes.reference_lines import Stretch, reference_lines
from foretwin.world_gen.roads.road_graph import DirectedEdge, EdgeKey, RoadEdge
from foretwin.world_gen.roads.road_tags import in_tunnel, on_bridge

Role = Literal["approach", "exit", "ring", "other"]


class LaneKey(NamedTuple):
    """A lane before it is cut to the World: edge index, direction, number in its section."""

    edge: int
    reverse: bool
    number: int


class LaneDraft(msgspec.Struct):
    """A lane while the World is being built."""

    id: str
    key: LaneKey
    edge: RoadEdge
    plan: LanePlan
    kind: LaneKind
    width_m: Quantity
    centerline: Array
    role: Role
    turns: tuple[Turn, ...]
    road_id: str
    left_id: str | None = None
    right_id: str | None = None
    successors: list[str] = msgspec.field(default_factory=list)
    position_source: PlaceSource | msgspec.UnsetType = msgspec.UNSET

    @property
    def speed_limit_mps(self) -> Quantity:
        """The lane's own limit, else that of its road in its direction."""
        of_road = DirectedEdge(self.edge, self.plan.reverse).speed_limit_mps
        return self.plan.speed_limit_mps or of_road

    def finished(self) -> Lane:
        """Return the lane as the World holds it."""
        return Lane(
            id=self.id,
            osm_way=self.edge.way_id,
            name=self.edge.name,
            kind=self.kind,
            centerline=self.centerline,
            width_m=self.width_m,
            speed_limit_mps=self.speed_limit_mps,
            role=self.role,
            turns=self.turns,
            turns_source=self.plan.turns_source,
            direction_source=self.plan.direction_source,
            change=self.plan.change,
            change_source=self.plan.change_source,
            left_id=self.left_id,
            right_id=self.right_id,
            road_id=self.road_id,
            reverse=self.plan.reverse,
            left_of_reference_m=round(self.plan.left_m, 3),
            layer=self.edge.layer,
            successor_ids=tuple(sorted(set(self.successors))),
            position_source=self.position_source,
        )


class LaneSet(msgspec.Struct, frozen=True):
    """All lanes of a World; `begins` and `ends` hold those not cut off by the World's edge."""

    lanes: Mapping[str, LaneDraft]
    roads: tuple[Road, ...]
    edges: Mapping[str, tuple[Array, Array]]
    """Left and right edge (N, 2) of each road's carriageway, along its reference line."""
    begins: Mapping[tuple[int, bool, int], LaneDraft]
    ends: Mapping[tuple[int, bool, int], LaneDraft]
    notes: tuple[str, ...]

    @property
    def before(self) -> dict[str, LaneDraft]:
        """The lane that ends exactly where another one, by its id, goes on: one road's."""
        return {
            name: lane
            for lane in self.lanes.values()
            for name in lane.successors
            if name in self.lanes
        }

    def ending(self, toward: DirectedEdge, plan: LanePlan) -> LaneDraft | None:
        """Return the lane of a plan that ends where `toward` ends; None where it was left out."""
        return self.ends.get((*toward.key, plan.number))

    def beginning(self, away: DirectedEdge, plan: LanePlan) -> LaneDraft | None:
        """Return the lane of a plan that begins where `away` begins; None where it was left out."""
        return self.begins.get((*away.key, plan.number))

    def incoming(self, toward: DirectedEdge, plans: tuple[LanePlan, ...]) -> list[LaneDraft]:
        """Return the lanes that end where `toward` ends, from the left."""
        return [lane for plan in plans if (lane := self.ending(toward, plan)) is not None]

    def outgoing(self, away: DirectedEdge, plans: tuple[LanePlan, ...]) -> list[LaneDraft]:
        """Return the lanes that begin where `away` begins, from the left."""
        return [lane for plan in plans if (lane := self.beginning(away, plan)) is not None]


def build_lanes(around: Surroundings) -> LaneSet:
    """Return every car lane within the World's extent, joined to lanes that simply go on."""
    stretches, notes = reference_lines(around)
    notes.extend(around.notes)
    sections = [around.sections[stretch.edge] for stretch in stretches]
    for index in dict.fromkeys(stretch.edge for stretch in stretches):
        notes.extend(around.sections[index].notes)
    lines = Polylines.of([stretch.line for stretch in stretches])
    references = iter(Polylines(np.round(lines.xy_m, 3), lines.first).split())
    curves = iter(_offsets(lines, stretches, sections))
    legs = {leg.key: (cluster.key, leg) for cluster in around.clusters for leg in cluster.legs}
    places = {key: place for key, (place, _) in legs.items()}
    lanes: dict[str, LaneDraft] = {}
    roads: list[Road] = []
    borders: dict[str, tuple[Array, Array]] = {}
    names: Counter[str] = Counter()
    begins: dict[tuple[int, bool, int], LaneDraft] = {}
    ends: dict[tuple[int, bool, int], LaneDraft] = {}
    roles = _roles(around)
    for stretch, section in zip(stretches, sections, strict=True):
        index, edge = stretch.edge, around.edges[stretch.edge]
        # A name that the same map always gives; pieces and twins of an edge are counted.
        name = f"w{edge.way_id}.{edge.start_node}.{edge.end_node}"
        names[name] += 1
        road = name if names[name] == 1 else f"{name}#{names[name]}"
        borders[road] = (_line(next(curves)), _line(next(curves)))
        mine: list[LaneDraft] = []
        for plan in section.lanes:
            points = next(curves)
            if len(points) < 2:
                continue
            key = LaneKey(index, plan.reverse, plan.number)
            name = f"{road}.{plan.label}"
            role = roles.get((index, plan.reverse), "other") if plan.number >= 0 else "other"
            points = points[::-1] if plan.reverse else points
            lane = LaneDraft(
                name, key, edge, plan, plan.kind, plan.width_m, points, role, plan.turns, road
            )
            lanes[name] = lane
            mine.append(lane)
            if stretch.first:
                (ends if plan.reverse else begins)[key] = lane
            if stretch.last:
                (begins if plan.reverse else ends)[key] = lane
        _join_neighbours(mine)
        roads.append(
            Road(
                id=road,
                osm_way=edge.way_id,
                name=edge.name,
                road_class=edge.road_class,
                reference_line=next(references),
                left_m=round(section.left_m, 3),
                right_m=round(section.right_m, 3),
                lane_ids=tuple([lane.id for lane in mine]),
                lane_count_source=_lane_count_source(edge),
                from_place=places.get((index, False)) if stretch.first else None,
                to_place=places.get((index, True)) if stretch.last else None,
                layer=edge.layer,
                bridge=on_bridge(edge.tags),
                tunnel=in_tunnel(edge.tags),
            )
        )
    driven = ({(edge, reverse) for edge, reverse, _ in keys} for keys in (begins, ends))
    led_through = places_led_through(legs, *driven)
    known = tuple(without_dead_places(roads, led_through))
    return LaneSet(lanes, known, borders, begins, ends, tuple(notes))


def _lane_count_source(edge: RoadEdge) -> Provenance:
    sides = (edge.lanes_forward, edge.forward), (edge.lanes_backward, edge.backward)
    counts = [count.source for count, driven in sides if driven]
    return next((s for s in ("default", "inferred") if s in counts), "tagged")


def _offsets(
    lines: Polylines, stretches: list[Stretch], sections: list[CrossSection]
) -> list[Array]:
    """Return for each stretch its left and right edge and its lanes' middles, along the nodes."""
    if not stretches:
        return []
    left_m = [(s.left_m, s.right_m, *(plan.left_m for plan in s.lanes)) for s in sections]
    row = np.repeat(np.arange(len(stretches)), [len(mine) for mine in left_m])
    before = np.array([stretch.before for stretch in stretches])[row]
    after = np.array([stretch.after for stretch in stretches])[row]
    shift = np.array([value for mine in left_m for value in mine])
    shifted = without_repeats(offset(lines.rows(row), shift, before=before, after=after))
    return Polylines(np.round(shifted.xy_m, 3), shifted.first).split()


def _line(points: Array) -> Array:
    """Return an edge of a carriageway as a line, even where a bend shrinks it to a point."""
    return points if len(points) > 1 else np.repeat(points, 2, axis=0)


def _roles(around: Surroundings) -> dict[EdgeKey, Role]:
    """Return the role of lanes by (edge index, reverse)."""
    roles: dict[EdgeKey, Role] = {}
    on_ring = {n for c in around.clusters if c.whole and c.ring for n in c.nodes}
    inner = around.inner_edges
    for cluster in around.clusters:
        if not cluster.whole:
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


def _join_neighbours(mine: list[LaneDraft]) -> None:
    """Link lanes that cars drive the same way side by side."""
    of_number = {(lane.plan.reverse, lane.plan.number): lane for lane in mine if lane.plan.counted}
    for (reverse, number), lane in of_number.items():
        right = of_number.get((reverse, number + 1))
        if right is not None:
            lane.right_id, right.left_id = right.id, lane.id


def join_straight_on(cluster: Cluster, around: Surroundings, lanes: LaneSet) -> bool:
    """Join lanes that meet exactly where one road goes on; false where they do not."""
    if not cluster.plain or any(around.trims_m[leg.key] for leg in cluster.legs):
        return False
    for leg, other in (cluster.legs, cluster.legs[::-1]):
        toward = leg.back
        before, behind = around.lanes_along(toward), around.lanes_along(other)
        # Plans are paired, not lanes: a lane too short to be drawn must not shift its neighbours.
        for mine, its in ((before.abreast, behind.abreast), (before.cycled, behind.cycled)):
            for a, b in zip(mine, its, strict=False):
                start, end = lanes.ending(toward, a), lanes.beginning(other, b)
                if start is not None and end is not None and a.kind in (b.kind, "bus"):
                    start.successors.append(end.id)
    return True
