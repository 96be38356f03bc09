"""Real junctions become Worlds and models: a fixed sample here, all of them in `make judge`."""

from __future__ import annotations

import math
import re
from functools import lru_cache
from pathlib import Path

import mujoco
import numpy as np
import pytest
from shapely.geometry import LineString, MultiLineString

from foretwin.contracts.codec import content_bytes, decode, encode
from foretwin.contracts.world import Lane, Road, World
from foretwin.geometry.steering import LEAST_RADIUS_M
from foretwin.world_gen.build import build_world
from foretwin.world_gen.export.mjcf import world_spec
from foretwin.world_gen.junctions.find_intersections import find_intersections
from foretwin.world_gen.junctions.intersections import Junction
from foretwin.world_gen.junctions.map_index import MapIndex, index_map
from foretwin.world_gen.lanes.cross_section import LEAST_HALF_M
from foretwin.world_gen.osm.read_osm import read_map
from foretwin.world_gen.roads.build_graph import build_road_graph
from tests.world_gen.path_shape import end_bends_rad, tightest_radius_m
from tests.world_gen.slip_roads import check_lines

MAPS = {
    "berlin": "osm-berlin-mitte/berlin-mitte.osm",
    "moritzplatz": "osm-berlin-moritzplatz/berlin-moritzplatz.osm",
    "kingsway": "osm-kingsway/kingsway_junction.osm",
    "badhersfeld": "osm-badhersfeld/badhersfeld.osm.xml.gz",
    "monaco": "osm-monaco/monaco.osm.gz",
    "liechtenstein": "osm-liechtenstein/liechtenstein-latest.osm.pbf",
}
# Each an OSM node of the junction: signals, ring, dual carriageway, left-hand traffic, tunnels.
SAMPLE = [
    ("berlin", 25663150),  # Kronenstraße with Markgrafenstraße
    ("berlin", 25661969),  # Glinkastraße with Mohrenstraße
    ("moritzplatz", 29215047),  # the roundabout
    ("kingsway", 21653578),  # seven nodes, slip roads, left-hand
    ("badhersfeld", 2333014135),  # several nodes with signals and turn lanes
    ("badhersfeld", 1698047149),
    ("monaco", 25195725),
    ("monaco", 21918402),
    ("liechtenstein", 2262648033),  # Hiltikreisel
]


@lru_cache(maxsize=1)
def _place(data_dir: Path, name: str) -> tuple[MapIndex, tuple[Junction, ...]]:
    osm = read_map(data_dir / MAPS[name])
    graph = build_road_graph(osm)
    junctions = find_intersections(osm, graph)
    return index_map(osm, graph, junctions), junctions


def _build(index: MapIndex, junction: Junction) -> World:
    return build_world(index.osm, index.graph, junction, index=index)


def _check(world: World, junction: Junction) -> None:
    """Fail where a World contradicts itself; compile and step its model."""
    lanes = {lane.id: lane for lane in world.lanes}
    connections = {c.id for c in world.connections}
    assert len(lanes) == len(world.lanes)
    assert len(connections) == len(world.connections)
    assert len(world.junctions[0].arms) == junction.summary.arms
    tight = {
        (int(found[1]), int(found[2]))
        for note in world.notes
        if (found := re.match(r"way (\d+): room for a radius of .* into way (\d+) ", note))
    }
    for lane in world.lanes:
        assert lane.width_m.value >= (0.8 if lane.kind == "bicycle" else LEAST_HALF_M)
        assert len(lane.centerline) >= 2
        assert np.isfinite(lane.centerline).all()
        assert set(lane.successor_ids) <= lanes.keys() | connections
    for c in world.connections:
        a, b = lanes[c.from_lane_id].centerline, lanes[c.to_lane_id].centerline
        np.testing.assert_array_equal(c.centerline[[0, -1]], [a[-1], b[0]])
        assert max(end_bends_rad(a, c.centerline, b)) < math.radians(1.0)
        ways = lanes[c.from_lane_id].osm_way, lanes[c.to_lane_id].osm_way
        assert ways in tight or tightest_radius_m(c.centerline) > 0.93 * LEAST_RADIUS_M
        assert set(c.yields_to) <= set(c.conflicts_with) <= connections
    astray = [
        lane.id
        for road in world.roads
        for lane in map(lanes.__getitem__, road.lane_ids)
        if _off_reference_m(road, lane) > 0.02
    ]
    # In hairpins no lane can follow the inside.
    assert len(astray) <= max(4, 0.02 * len(lanes)), astray
    paths = {part.id: part.centerline for part in (*world.lanes, *world.connections)}
    for line in world.stop_lines:
        # Where the map parts a road at a crossing it lies across the lane before.
        before = [b.centerline for b in world.lanes if line.across_id in b.successor_ids]
        across = LineString(line.ends)
        assert across.distance(MultiLineString([paths[line.across_id], *before])) < 0.001
    assert check_lines(world) == sum(line.connection_id is not None for line in world.stop_lines)
    for signal in world.signals:
        assert set(signal.lane_ids) <= lanes.keys()
    approaches = {lane.id for lane in world.lanes if lane.role in ("approach", "ring")}
    assert any(c.from_lane_id in approaches for c in world.connections)
    model = world_spec(world, visual=False).compile()
    data = mujoco.MjData(model)
    mujoco.mj_step(model, data)
    assert data.time > 0.0


def _off_reference_m(road: Road, lane: Lane) -> float:
    """Return how far a lane lies from where its road's reference line puts it."""
    if lane.left_of_reference_m == 0.0:
        beside = LineString(road.reference_line)
        return float(LineString(lane.centerline).hausdorff_distance(beside))
    line = LineString(road.reference_line)
    beside = line.offset_curve(lane.left_of_reference_m, join_style="mitre")
    return float(LineString(lane.centerline).hausdorff_distance(beside))


@pytest.mark.real_data
@pytest.mark.parametrize(("name", "node"), SAMPLE)
def test_a_real_junction_becomes_a_world(data_dir, name, node):
    index, junctions = _place(data_dir, name)
    junction = next(j for j in junctions if node in j.nodes)
    world = _build(index, junction)
    _check(world, junction)
    world_spec(world).compile()
    again = _build(index, junction)
    assert again.id == world.id
    assert content_bytes(decode(encode(world), World).message) == content_bytes(world)


@pytest.mark.real_data
def test_moritzplatz_is_driven_around(data_dir):
    index, junctions = _place(data_dir, "moritzplatz")
    junction = next(j for j in junctions if 29215047 in j.nodes)
    world = _build(index, junction)
    assert any(island.id.startswith("island:ring") for island in world.islands)
    assert {lane.role for lane in world.lanes} >= {"ring", "approach", "exit"}
    mine = [c for c in world.connections if c.junction_id == junction.summary.id]
    assert all(c.control != "none" for c in mine if "approach" in _role(world, c))


def _role(world: World, connection) -> str:
    return next(lane.role for lane in world.lanes if lane.id == connection.from_lane_id)


@pytest.mark.real_data
@pytest.mark.judge
@pytest.mark.timeout(1800)
@pytest.mark.parametrize("name", ["monaco", "badhersfeld", "liechtenstein"])
def test_every_junction_becomes_a_world_and_a_model(data_dir, name):
    index, junctions = _place(data_dir, name)
    assert junctions
    failures = []
    for junction in junctions:
        try:
            _check(_build(index, junction), junction)
        except Exception as error:
            failures.append(f"{junction.summary.id}: {error!r}")
    assert not failures, f"{len(failures)} of {len(junctions)}: {failures[:5]}"


@pytest.mark.real_data
def test_who_goes_round_an_island_into_the_other_carriageway_turns_back(data_dir):
    index, junctions = _place(data_dir, "moritzplatz")
    (junction,) = (j for j in junctions if 1285251502 in j.nodes)
    world = _build(index, junction)
    turns = {
        c.turn
        for c in world.connections
        if c.from_lane_id.startswith("w4612756.29217276.1285251502.f0")
        and c.to_lane_id.startswith("w4612758.29217276.1285251472")
    }
    # By 210 degrees to the left, though both lanes have an angle of 150 to the right.
    assert turns == {"u_turn"}
