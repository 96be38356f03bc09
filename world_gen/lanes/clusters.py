"""The roads around a junction in the World's frame, and the places where their lanes meet."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from types import MappingProxyType
from typing import NamedTuple

import msgspec
import numpy as np
import shapely
import shapely.ops

from foretwin.contracts.frames import GeoPoint, LocalFrame, target_from_source_m
from foretwin.contracts.world import DrivingSide
from foretwin.geometry.polyline import points_at
from foretwin.geometry.polyline_batch import Polylines
from foretwin.world_gen.extent import Extent
from foretwin.world_gen.junctions.intersections import Junction
from foretwin.world_gen.junctions.map_index import MapIndex
from foretwin.world_gen.lanes.cluster import Cluster, clusters_of
from foretwin.world_gen.lanes.cross_section import cross_section, widened
from foretwin.world_gen.lanes.lane_plans import CrossSection, LanesAlong
from foretwin.world_gen.lanes.legs import Heads, is_ring_edge
from foretwin.world_gen.lanes.past_driveways import JoinedRoads, past_driveways
from foretwin.world_gen.lanes.places import whole_where_led_through
from foretwin.world_gen.lanes.ring_curves import ring_curves
from foretwin.world_gen.lanes.transitions import transition_shifts
from foretwin.world_gen.lanes.trims import trims
from foretwin.world_gen.roads.conditional_tags import condition_notes
from foretwin.world_gen.roads.headings import heading_out
from foretwin.world_gen.roads.joined_edges import read_tags
from foretwin.world_gen.roads.node_notes import barrier_notes, level_crossing_notes, level_notes
from foretwin.world_gen.roads.road_graph import DirectedEdge, EdgeKey, RoadEdge, country_of, side_of
from foretwin.world_gen.roads.tidal_roads import tidal_notes
from foretwin.world_gen.roads.turn_restrictions import restriction_notes

_REPEAT_M = 0.01
_SAME_END_M = 0.01


class Surroundings(msgspec.Struct, frozen=True, kw_only=True):
    """Everything around a place in the World's frame; edges and sections by edge index.

    `junctions` are all that lie whole in the World, the one it is made for first.
    """

    frame: LocalFrame
    junctions: tuple[Junction, ...]
    extent: Extent
    driving_side: DrivingSide
    country: str
    """Code of the country in which most of its roads lie."""
    edges: Mapping[int, RoadEdge]
    sections: Mapping[int, CrossSection]
    clusters: tuple[Cluster, ...]
    trims_m: Mapping[EdgeKey, float]
    """Metres cut off an edge's lanes by (edge index, at its end node)."""
    heads: Heads
    """Where every leg of a cluster leaves it."""
    ring_edges: frozenset[int]
    shifts_m: Mapping[int, tuple[float, float]]
    """How far left of their way roads in a transition begin and end, by edge index."""
    joined: JoinedRoads
    notes: tuple[str, ...] = ()

    @property
    def inner_edges(self) -> frozenset[int]:
        """Indices of the edges inside whole junctions."""
        return frozenset(i for junction in self.junctions for i in junction.inner)

    def lanes_along(self, edge: DirectedEdge) -> LanesAlong:
        """Return the lanes that are driven as an edge is."""
        return self.sections[edge.edge.index].along(reverse=edge.reverse)

    def section(self, edge: DirectedEdge) -> CrossSection:
        """Return the cross-section of a directed edge's road."""
        return self.sections[edge.edge.index]


def in_map(extent: Extent, frame: LocalFrame, map_frame: LocalFrame) -> shapely.Polygon:
    """Return a World's extent in the map's frame."""
    return shapely.transform(extent.polygon, lambda xy: target_from_source_m(map_frame, frame, xy))


def world_frame(junction: Junction) -> LocalFrame:
    """Return the frame of a junction's World: its origin is the junction's centre."""
    return LocalFrame(GeoPoint(junction.summary.lat, junction.summary.lon))


def surroundings(
    index: MapIndex,
    frame: LocalFrame,
    extent: Extent,
    made_for: tuple[Junction, ...],
    *,
    moved: Mapping[int, RoadEdge] = MappingProxyType({}),
    least_trims_m: Mapping[EdgeKey, float] = MappingProxyType({}),
    widths: Mapping[int, float] = MappingProxyType({}),
) -> Surroundings:
    """Collect the roads within `extent` of the frame's origin and cluster their nodes.

    Roads of the junctions in `made_for` are kept even where they lie beyond. `moved` are roads
    that lie elsewhere than the map has them, by edge index, in this frame already;
    `least_trims_m` are metres that lanes end at least before a place, as in `trims_m`;
    `widths` are how many times as wide lanes are where no tag tells, by edge index.
    """
    graph = index.graph
    area = in_map(extent, frame, graph.frame)
    wanted = set(index.car_edges_in(area))
    for junction in made_for:
        legs = (leg.edge for arm in junction.arms for leg in arm.outward)
        near = (*(graph.edges[i] for i in junction.inner), *legs)
        wanted.update(edge.index for edge in near if edge.drivable)
    edges = _in_frame([graph.edges[i] for i in sorted(wanted)], frame, graph.frame)
    edges.update(ring_curves(edges))
    joined, laid = _past_driveways(index, made_for, edges, extent)
    made_for = tuple([joined.junction(junction) for junction in made_for])
    edges = {**joined.edges(edges), **moved}
    if moved or least_trims_m or widths:
        laid = _laid(index, made_for, joined, edges, extent, least_trims_m, widths)
    sections, heads, cut_m = laid.sections, laid.heads, laid.trims_m
    clusters = whole_where_led_through(laid.clusters, made_for, cut_m, extent)
    whole = {id(c.junction): c.junction for c in clusters if c.whole and c.junction is not None}
    inner = {i for junction in whole.values() for i in junction.inner}
    ring_edges = frozenset(i for i in inner if i in edges and is_ring_edge(edges[i]))
    side = made_for[0].summary.driving_side if made_for else side_of(edges.values())
    return Surroundings(
        frame=frame,
        junctions=tuple(whole.values()),
        extent=extent,
        driving_side=side,
        country=country_of(edges.values()),
        edges=edges,
        sections=sections,
        clusters=clusters,
        trims_m=cut_m,
        heads=heads,
        shifts_m=laid.shifts_m,
        ring_edges=ring_edges,
        joined=joined,
        notes=(
            *restriction_notes(index.restrictions, [c.inner for c in clusters], edges),
            *barrier_notes(edges.values(), graph.closed_nodes, index.osm.node_tags),
            *level_notes((graph.edges[i] for i in edges), graph.passed_over),
            *level_crossing_notes((graph.edges[i] for i in edges), index.osm.node_tags),
            *tidal_notes(edges.values()),
            *condition_notes(edges.values()),
            *_side_notes(edges, side),
            *_beyond_notes(made_for, edges, cut_m, extent),
        ),
    )


class _Layout(NamedTuple):
    """Where the lanes of some roads end; see `Surroundings`."""

    sections: Mapping[int, CrossSection]
    clusters: tuple[Cluster, ...]
    shifts_m: Mapping[int, tuple[float, float]]
    heads: Heads
    trims_m: Mapping[EdgeKey, float]


def _laid(
    index: MapIndex,
    made_for: tuple[Junction, ...],
    joined: JoinedRoads,
    edges: Mapping[int, RoadEdge],
    extent: Extent,
    least_trims_m: Mapping[EdgeKey, float] = MappingProxyType({}),
    widths: Mapping[int, float] = MappingProxyType({}),
) -> _Layout:
    sections = _sections(index, edges)
    sections |= {i: widened(sections[i], factor) for i, factor in widths.items()}
    clusters = clusters_of(index, made_for, joined, edges, extent)
    shifts = transition_shifts(clusters, edges, sections)
    heads = {leg.key: heading_out(leg) for c in clusters for leg in c.legs}
    cut_m = trims(clusters, edges, sections, shifts, heads, least_trims_m, index.osm.node_tags)
    return _Layout(sections, clusters, shifts, heads, cut_m)


def _past_driveways(
    index: MapIndex, made_for: tuple[Junction, ...], edges: Mapping[int, RoadEdge], extent: Extent
) -> tuple[JoinedRoads, _Layout]:
    """Return the roads that go on from a junction past driveways, where their lanes then end
    elsewhere there, and the layout with them."""

    def laid(joined: JoinedRoads) -> _Layout:
        return _laid(index, made_for, joined, joined.edges(edges), extent)

    nothing, all_of_them = JoinedRoads(), past_driveways(index.graph, edges, index.junction_of_node)
    parted = laid(nothing)
    if not all_of_them.parts:
        return nothing, parted
    whole = laid(all_of_them)
    changed = {}
    for road, parts in all_of_them.parts.items():
        ends = (parts[0], edges[parts[0]].start_node), (parts[-1], edges[parts[-1]].end_node)
        for reverse, (part, node) in zip((False, True), ends, strict=True):
            moved_m = whole.trims_m.get((road, reverse), 0.0) - parted.trims_m.get(
                (part, reverse), 0.0
            )
            if node in index.junction_of_node and abs(moved_m) > _SAME_END_M:
                changed[road] = parts
    if not changed:
        return nothing, parted
    joined = JoinedRoads(changed)
    return joined, whole if changed == all_of_them.parts else laid(joined)


def _side_notes(edges: Mapping[int, RoadEdge], side: DrivingSide) -> list[str]:
    """Name the ways that are driven on the other side than the World's junctions."""
    others = {
        edge.way_id: edge.driving_side for edge in edges.values() if edge.driving_side != side
    }
    return [f"way {way}: traffic keeps {its}, around it {side}" for way, its in others.items()]


def _beyond_notes(
    made_for: tuple[Junction, ...],
    edges: Mapping[int, RoadEdge],
    trims_m: Mapping[EdgeKey, float],
    extent: Extent,
) -> Iterator[str]:
    """Name the ways in and out of the junctions in `made_for` whose lanes begin beyond."""
    legs = (leg for junction in made_for for arm in junction.arms for leg in arm.outward)
    for leg in legs:
        if leg.edge.index in edges:
            line = DirectedEdge(edges[leg.edge.index], leg.reverse).xy_m
            if not extent.holds(points_at(line, np.array([trims_m.get(leg.key, 0.0)]))).all():
                yield (
                    f"way {leg.edge.way_id}: begins beyond the World, {extent.radius_m:.0f} m "
                    "about the junction; left out, with its turns"
                )


_WITHOUT_EFFECT_ON_LANES = frozenset({"ref", "maxspeed", "lit", "source"})
"""Beside what nobody reads: what is told of a road's limit, and its number."""


def _sections(index: MapIndex, edges: Mapping[int, RoadEdge]) -> dict[int, CrossSection]:
    """Return cross-sections by edge index; ways with the same tags share theirs."""
    known: dict[object, CrossSection] = {}
    found: dict[int, CrossSection] = {}
    for i, edge in edges.items():
        # A centre lane for turns is driven toward the junction, where there is one.
        centre_reverse = (
            "lanes:both_ways" in edge.tags
            and edge.start_node in index.junction_of_node
            and edge.end_node not in index.junction_of_node
        )
        of_place = edge.driving_side, edge.country
        driven = (edge.forward, edge.backward, *of_place, centre_reverse)
        way = (edge.way_id, *driven)
        if way not in known:
            read = read_tags(edge.tags).items()
            tags = (kv for kv in read if kv[0] not in _WITHOUT_EFFECT_ON_LANES)
            lanes = (edge.lanes_forward, edge.lanes_backward)
            alike = (edge.road_class, *driven, *lanes, frozenset(tags))
            known[way] = known.get(alike) or cross_section(edge, centre_reverse=centre_reverse)
            if not known[way].notes:  # these name the way
                known[alike] = known[way]
        found[i] = known[way]
    return found


def _in_frame(
    edges: list[RoadEdge], frame: LocalFrame, map_frame: LocalFrame
) -> dict[int, RoadEdge]:
    """Return edges in the World's frame by index, without those that are but a point."""
    lines = Polylines.of([edge.xy_m for edge in edges])
    moved = Polylines(target_from_source_m(frame, map_frame, lines.xy_m), lines.first)
    step_m = np.maximum.reduceat(moved.steps[1] * ~moved.is_last, moved.first[:-1]).tolist()
    return {
        edge.index: msgspec.structs.replace(edge, xy_m=xy)
        for edge, xy, longest_m in zip(edges, moved.split(), step_m, strict=True)
        if longest_m > _REPEAT_M
    }
