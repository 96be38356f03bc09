"""Find every junction of a map, each one as a driver sees it."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from foretwin.contracts.arrays import Array
from foretwin.contracts.frames import geo_from_local
from foretwin.contracts.world import IntersectionSummary, JunctionKind
from foretwin.world_gen.countries.rules import rules_of
from foretwin.world_gen.junctions.chains import CarRoads, car_roads
from foretwin.world_gen.junctions.grouping import JunctionCluster
from foretwin.world_gen.junctions.intersections import Junction
from foretwin.world_gen.junctions.junction_arms import ArmChains, ClusterRoads, approaches, roads_of
from foretwin.world_gen.junctions.junction_clusters import cluster_branchings
from foretwin.world_gen.junctions.junction_control import control_of
from foretwin.world_gen.osm.osm_map import OsmMap
from foretwin.world_gen.roads.road_graph import RoadGraph, country_of, side_of

STAGGER_M = 8.0
"""Opposite arms whose axes lie farther apart make a junction staggered."""
MERGE_RAD = math.radians(50.0)
"""A one-way road joins or leaves at no larger angle, else drivers turn."""
THROUGH_RAD = math.radians(35.0)
BESIDE_RAD = math.radians(45.0)
"""The stem of a T meets a road that bends no more, at no smaller angle; else the three make a Y."""


def find_intersections(osm: OsmMap, graph: RoadGraph) -> tuple[Junction, ...]:
    """Return the junctions of a map, by id.

    One roundabout is one junction with the nodes where its arms part; so are the crossings of
    dual carriageways, offset branchings close to each other, and corners with slip roads. Where
    fewer than three roads meet is none: a street that parts into its carriageways, a turning
    place in the median, a change of name or lanes, a driveway. Roads at different levels share
    no node and do not meet. The result for one place does not depend on the rest of the map.
    """
    roads = car_roads(osm, graph)
    clusters = cluster_branchings(roads, graph, osm.node_tags)
    found_places = (_place(cluster, roads, osm, graph) for cluster in clusters)
    places = [place for place in found_places if place is not None]
    if not places:
        return ()
    centres = np.array([_centre_xy_m(place.cluster, graph) for place in places])
    degrees = geo_from_local(graph.frame, centres).tolist()
    rows = zip(places, centres, degrees, strict=True)
    found = (_junction(*row, osm, graph) for row in rows)
    return tuple(sorted(found, key=lambda junction: junction.summary.id))


class _JunctionDraft(NamedTuple):
    """A junction to be: its branchings, its roads and arms, all its graph nodes."""

    cluster: JunctionCluster
    around: ClusterRoads
    arms: tuple[ArmChains, ...]
    mini: bool
    nodes: frozenset[int]


def _place(
    cluster: JunctionCluster, roads: CarRoads, osm: OsmMap, graph: RoadGraph
) -> _JunctionDraft | None:
    """Return what meets at a cluster; None where no three roads do."""
    around = roads_of(cluster, roads, graph)
    if len(around.leaving) < 2 and cluster.ring is None:
        return None
    arms = approaches(around.leaving)
    mini = "mini_roundabout" in [
        osm.node_tags[node].get("highway") for node in cluster.core if node in osm.node_tags
    ]
    if len(arms) < 3 and cluster.ring is None and not (mini and len(arms) == 2):
        return None
    between = [node for chain in around.inside for node in chain.inner_nodes]
    return _JunctionDraft(cluster, around, arms, mini, frozenset(cluster.nodes).union(between))


def _junction(
    place: _JunctionDraft, centre: Array, lat_lon_deg: list[float], osm: OsmMap, graph: RoadGraph
) -> Junction:
    cluster, around, arms, mini, nodes = place
    inner = {item.edge.index for chain in around.inside for item in chain.edges}
    ring_edges = cluster.ring.edges if cluster.ring is not None else ()
    inner.update([edge.index for edge in ring_edges])
    centre_xy_m = centre.tolist()
    kind = _kind(cluster, arms, mini)
    lat_deg, lon_deg = lat_lon_deg
    core = frozenset(cluster.core)
    incoming = tuple([chain for item in arms for chain in item.chains if chain.inward])
    ring = kind in ("roundabout", "mini_roundabout")
    legs = [leg.edge for item in arms for leg in item.arm.outward]
    all_way = rules_of(country_of(legs)).all_way_stops
    control, lights = control_of(
        core,
        around.inside,
        incoming,
        osm.node_tags,
        ring=ring,
        ring_edges=ring_edges,
        all_way_stops=all_way,
        leaving=graph.leaving,
    )
    return Junction(
        summary=IntersectionSummary(
            id=f"n{min(cluster.core)}",
            kind=kind,
            lat=round(lat_deg, 7),
            lon=round(lon_deg, 7),
            arms=len(arms),
            control=control,
            driving_side=side_of(legs),
            osm_nodes=tuple(sorted(nodes)),
            name=_name(cluster, arms),
        ),
        centre_xy_m=centre,
        nodes=nodes,
        inner=tuple(sorted(inner)),
        arms=tuple([item.arm for item in arms]),
        radius_m=max([math.dist(centre_xy_m, graph.node_xy_m[node]) for node in nodes]),
        lights=lights,
    )


def _centre_xy_m(cluster: JunctionCluster, graph: RoadGraph) -> tuple[float, float]:
    """Return the mean of the core nodes, of a ring the middle of its line."""
    if cluster.ring is None:
        return graph.middle_of(cluster.core)
    lines = [edge.xy_m for edge in cluster.ring.edges]
    middles = [(line[1:] + line[:-1]) / 2.0 for line in lines]
    lengths = [np.linalg.norm(np.diff(line, axis=0), axis=1) for line in lines]
    centre = np.average(np.vstack(middles), axis=0, weights=np.concatenate(lengths))
    return float(centre[0]), float(centre[1])


def _kind(cluster: JunctionCluster, arms: tuple[ArmChains, ...], mini: bool) -> JunctionKind:
    if cluster.ring is not None:
        return "roundabout" if cluster.ring.kind == "roundabout" else "circular"
    if mini:
        return "mini_roundabout"
    if _is_merge(arms):
        return "merge"
    if len(arms) == 3:
        return "t_junction" if _has_through_road(arms) else "y_junction"
    if len(arms) == 4:
        return "staggered" if _is_staggered(arms) else "crossing"
    return "crossing" if len(arms) > 4 else "other"


def _is_merge(arms: tuple[ArmChains, ...]) -> bool:
    """Tell whether one-way roads join to one, or one parts, without a turn."""
    if len(arms) != 3 or any(len(item.chains) != 1 for item in arms):
        return False
    chains = [item.chains[0] for item in arms]
    if not all(chain.one_way for chain in chains):
        return False
    outward = [item for item in arms if item.chains[0].outward]
    inward = [item for item in arms if item.chains[0].inward]
    pair = outward if len(outward) == 2 else inward
    if len(pair) != 2:
        return False
    a, b = (item.arm.bearing_rad for item in pair)
    return abs(math.remainder(a - b, math.tau)) <= MERGE_RAD


def _has_through_road(arms: tuple[ArmChains, ...]) -> bool:
    """Tell whether one of three roads meets the other two from the side, as a stem does."""
    for stem in range(3):
        a, b = (arms[i].arm.bearing_rad for i in range(3) if i != stem)
        straight = abs(math.remainder(a - b + math.pi, math.tau)) <= THROUGH_RAD
        sides = (math.remainder(arms[stem].arm.bearing_rad - other, math.tau) for other in (a, b))
        if straight and all(abs(side) >= BESIDE_RAD for side in sides):
            return True
    return False


def _is_staggered(arms: tuple[ArmChains, ...]) -> bool:
    """Tell whether a road of four does not go straight on, but meets the other with an offset."""
    pairings = (((0, 1), (2, 3)), ((0, 2), (1, 3)), ((0, 3), (1, 2)))

    def opposition(pairing: tuple[tuple[int, int], tuple[int, int]]) -> float:
        return sum(math.cos(arms[i].arm.bearing_rad - arms[j].arm.bearing_rad) for i, j in pairing)

    for i, j in min(pairings, key=opposition):
        a, b = arms[i], arms[j]
        axis = math.atan2(
            math.sin(a.arm.bearing_rad) - math.sin(b.arm.bearing_rad),
            math.cos(a.arm.bearing_rad) - math.cos(b.arm.bearing_rad),
        )
        dx, dy = (p - q for p, q in zip(a.start_xy_m, b.start_xy_m, strict=True))
        if abs(dy * math.cos(axis) - dx * math.sin(axis)) > STAGGER_M:
            return True
    return False


def _name(cluster: JunctionCluster, arms: tuple[ArmChains, ...]) -> str:
    """Return the ring's own name, else the names of the roads that meet."""
    names = dict.fromkeys(item.arm.name for item in arms if item.arm.name)
    if cluster.ring is not None:
        own = [edge.tags["name"] for edge in cluster.ring.edges if "name" in edge.tags]
        if own and own[0] not in names:
            return own[0]
    return " \u00d7 ".join(sorted(names))
