"""Worlds on disk: the same World comes back, and nothing is built twice."""

from __future__ import annotations

import pytest

import foretwin.world_gen.world_store as world_store
from foretwin.contracts.codec import content_bytes
from foretwin.world_gen.junctions.find_intersections import find_intersections
from foretwin.world_gen.junctions.map_index import index_map
from foretwin.world_gen.roads.build_graph import build_road_graph
from foretwin.world_gen.roads.service_roads import with_service_roads
from foretwin.world_gen.world_store import WorldStore, cached_build
from tests.world_gen.drawn_maps import crossing


@pytest.fixture(scope="module")
def place():
    osm = crossing()
    graph = build_road_graph(osm)
    junctions = find_intersections(osm, graph)
    return index_map(osm, graph, junctions), junctions[0]


def test_a_world_is_built_once_and_found_by_another_store(tmp_path, place):
    index, junction = place
    built = cached_build(WorldStore(tmp_path), index, junction)
    again = cached_build(WorldStore(tmp_path), index, junction)
    assert (built.cached, again.cached) == (False, True)
    assert again.world.id == built.world.id
    assert content_bytes(again.world) == content_bytes(built.world)
    assert content_bytes(WorldStore(tmp_path).load(built.world.id)) == content_bytes(built.world)


def test_another_radius_or_generator_is_another_world(tmp_path, place, monkeypatch):
    index, junction = place
    store = WorldStore(tmp_path)
    cached_build(store, index, junction)
    assert not cached_build(store, index, junction, radius_m=60.0).cached
    monkeypatch.setattr(world_store, "GENERATOR_VERSION", world_store.GENERATOR_VERSION + 1)
    assert not cached_build(store, index, junction).cached


def test_roads_added_to_the_map_make_another_world(tmp_path):
    lane = (90, [1, 9], {"highway": "service"})
    osm = crossing(extra_nodes={9: (100.0, 30.0)}, extra_ways=[lane])
    graph = build_road_graph(osm)
    junctions = find_intersections(osm, graph)
    store = WorldStore(tmp_path)
    cached_build(store, index_map(osm, graph, junctions), junctions[0])
    wider = with_service_roads(graph)
    assert not cached_build(store, index_map(osm, wider, junctions), junctions[0]).cached
    assert cached_build(store, index_map(osm, graph, junctions), junctions[0]).cached


def test_a_damaged_world_is_built_anew(tmp_path, place):
    index, junction = place
    store = WorldStore(tmp_path)
    world = cached_build(store, index, junction).world
    store.path_of(world.id).write_bytes(b"FTw1 cut off")
    found = cached_build(store, index, junction)
    assert not found.cached
    assert content_bytes(store.load(world.id)) == content_bytes(world)


def test_a_world_that_is_not_there(tmp_path):
    with pytest.raises(FileNotFoundError, match="holds no world '0123456789abcdef'"):
        WorldStore(tmp_path).load("0123456789abcdef")
