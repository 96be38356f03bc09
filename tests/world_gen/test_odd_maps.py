"""Places off the Earth, strange ids, rings and values: noted by the object's id, or refused."""

from __future__ import annotations

import math
import time
from pathlib import Path

import pytest

from foretwin.contracts.frames import GeoPoint
from foretwin.world_gen.osm.map_store import MapStore
from foretwin.world_gen.osm.osm_map import LatLonBounds, MapError
from foretwin.world_gen.osm.read_osm import read_map
from tests.world_gen.chain import build_all
from tests.world_gen.map_files import both_ways, crossing, file_of, refused, with_more
from tests.world_gen.sketch import Sketch, star

COVERS = ("foretwin.world_gen.osm.map_assembly",)


def test_positions_that_are_not_on_earth(tmp_path: Path) -> None:
    text = with_more(
        '<node id="50" lat="95.5" lon="8"/><node id="51"/>'
        '<way id="200"><nd ref="1"/><nd ref="2"/><nd ref="50"/>'
        '<tag k="highway" v="residential"/></way>'
    )
    osm = both_ways(file_of(tmp_path, text), tmp_path)
    assert "node 50: 95.5, 8 is not on Earth; left out" in osm.notes
    assert "node 51: has no position; left out" in osm.notes
    assert "way 200: the map lacks its node 50; 2 of its 3 nodes are kept" in osm.notes


@pytest.mark.parametrize("lat", ["500", "nan", "", "1e9", "5,3"])
def test_numbers_that_are_none(tmp_path: Path, lat: str) -> None:
    text = with_more(f'<node id="50" lat="{lat}" lon="8"/>')
    refused(file_of(tmp_path, text), tmp_path, "not a readable OSM file")


def test_a_node_far_away_does_not_carry_the_map_off(tmp_path: Path) -> None:
    text = with_more(
        '<node id="50" lat="0" lon="0"/>'
        '<way id="200"><nd ref="1"/><nd ref="50"/><tag k="highway" v="primary"/></way>'
    )
    osm = both_ways(file_of(tmp_path, text), tmp_path)
    assert osm.notes == ("way 200: reaches over 54 degrees; left out",)
    assert abs(osm.frame.origin.lat_deg - 53.5) < 0.01


def test_roads_all_over_the_earth_are_refused(tmp_path: Path) -> None:
    text = with_more(
        '<node id="50" lat="-40" lon="170"/><node id="51" lat="-40" lon="170.01"/>'
        '<way id="200"><nd ref="50"/><nd ref="51"/><tag k="highway" v="primary"/></way>'
    )
    with pytest.raises(MapError, match=r"roads reach over .* cut out a region"):
        read_map(file_of(tmp_path, text))
    # An index has no such bounds: a place is clipped from it.
    store = MapStore.open(tmp_path / "map.osm", tmp_path / "index")
    assert len(store.clip(LatLonBounds(53.0, 8.0, 54.0, 9.0)).ways) == 4


@pytest.mark.parametrize("first", [-1000, 2**53 - 5, 2**62])
def test_ids_below_zero_and_beyond_the_usual(tmp_path: Path, first: int) -> None:
    sketch = Sketch()
    places = [(0.0, 0.0), (100.0, 0.0), (0.0, 100.0), (-100.0, 0.0), (0.0, -100.0)]
    for i, (x_m, y_m) in enumerate(places):
        sketch.node(first + i, x_m, y_m)
    for i in range(1, 5):
        sketch.road(first + 100 + i, [first, first + i], f"Arm {i}")
    osm = both_ways(file_of(tmp_path, sketch), tmp_path)
    assert osm.ways[first + 101].nodes == (first, first + 1)
    assert len(build_all(tmp_path / "map.osm").worlds) == 1


@pytest.mark.parametrize("word", ["9" * 30, "12x", "", "1.5"])
def test_ids_that_are_no_numbers(tmp_path: Path, word: str) -> None:
    text = with_more(f'<node id="{word}" lat="1" lon="8"/>')
    refused(file_of(tmp_path, text), tmp_path, "not a readable OSM file")


@pytest.mark.parametrize(
    "place",
    [GeoPoint(53.0, 180.0), GeoPoint(89.9995, 10.0), GeoPoint(-89.9995, 0.0), GeoPoint(0.0, 0.0)],
)
def test_the_antimeridian_and_the_poles(tmp_path: Path, place: GeoPoint) -> None:
    sketch = Sketch(place)
    for node, (x_m, y_m) in enumerate([(0, 0), (45, 0), (0, 45), (-45, 0), (0, -45)], start=1):
        sketch.node(node, x_m, y_m)
        if node > 1:
            sketch.road(100 + node, [1, node], f"Arm {node}")
    both_ways(file_of(tmp_path, sketch), tmp_path)
    built = build_all(tmp_path / "map.osm", radius_m=40.0)
    (world,) = built.worlds
    assert world.junctions[0].summary.arms == 4
    assert abs(world.frame.origin.lat_deg - place.lat_deg) < 1e-3


def test_a_way_that_passes_one_node_thousands_of_times(tmp_path: Path) -> None:
    sketch = crossing()
    sketch.road(200, [1, 2] * 3000, "Shuttle")
    osm = both_ways(file_of(tmp_path, sketch), tmp_path)
    assert osm.notes == ("way 200: passes node 1 3000 times; left out",)


def test_a_roundabout_of_ten_thousand_nodes(tmp_path: Path) -> None:
    count, radius_m = 10_000, 60.0
    sketch = Sketch()
    for i in range(count):
        angle = 2.0 * math.pi * i / count
        sketch.node(1000 + i, radius_m * math.cos(angle), radius_m * math.sin(angle))
    ring = [*range(1000, 1000 + count), 1000]
    sketch.road(10, ring, junction="roundabout", oneway="yes")
    for arm in range(4):
        angle = math.pi / 2.0 * arm
        sketch.node(1 + arm, 150.0 * math.cos(angle), 150.0 * math.sin(angle))
        sketch.road(20 + arm, [1000 + arm * count // 4, 1 + arm], f"Arm {arm}")
    begin_s = time.process_time()
    (world,) = build_all(file_of(tmp_path, sketch)).worlds
    assert world.intersection.kind == "roundabout"
    assert world.intersection.arms == 4
    # Work that grows with the square of the nodes would take minutes.
    assert time.process_time() - begin_s < 10.0


def test_relations_in_a_circle_and_of_nothing(tmp_path: Path) -> None:
    text = with_more(
        '<relation id="1"><member type="relation" ref="2" role="outer"/>'
        '<member type="way" ref="102" role="outer"/>'
        '<tag k="type" v="multipolygon"/><tag k="building" v="yes"/></relation>'
        '<relation id="2"><member type="relation" ref="1" role="outer"/>'
        '<tag k="type" v="multipolygon"/><tag k="building" v="yes"/></relation>'
        '<relation id="3"><tag k="type" v="restriction"/><tag k="restriction" v="no_u_turn"/>'
        "</relation>"
    )
    osm = read_map(file_of(tmp_path, text))
    assert list(osm.relations) == [1]
    assert "relation 2: the map holds none of its ways; left out" in osm.notes
    assert "relation 3: the map holds none of its ways; left out" in osm.notes
    built = build_all(tmp_path / "map.osm")
    assert len(built.worlds) == 1
    assert "relation 1" in built.notes


def test_buildings_that_cross_themselves(tmp_path: Path) -> None:
    sketch = crossing()
    bow = [(30, 30), (60, 60), (60, 30), (30, 60)]
    for i, (x_m, y_m) in enumerate(bow):
        sketch.node(30 + i, x_m, y_m)
        sketch.node(40 + i, -x_m, y_m if i != 2 else 30 + 1e-6)
    sketch.way(300, [30, 31, 32, 33, 30], building="yes")
    sketch.way(301, [40, 41, 42, 40], building="yes")
    sketch.way(302, [40, 41, 40, 41, 40], building="yes")
    sketch.way(303, [30, 31, 32], building="yes")
    built = build_all(file_of(tmp_path, sketch))
    (world,) = built.worlds
    assert any(building.id.startswith("w300") for building in world.buildings)
    assert "way 303" in built.notes


STRANGE_TAGS = {
    "lanes": ["-3", "0", "999", "1e9", "nan", "2.5", "two", "", "3;2", "1" * 400],
    "maxspeed": ["walk", "none", "-50", "1e400", "50 mph", "DE:urban", "∞", "20;30"],
    "width": ["-3", "0", "1e9", "nan", "3,5", "12'6\"", "wide"],
    "turn:lanes": ["|||||", "left|through;right|", "none|" * 200, "left;left", "\N{TRAM CAR}"],
    "oneway": ["maybe", "-1", "reversible", "yes;no"],
    "layer": ["-99999999999", "x", "1;2", "0.5"],
    "placement": ["right_of:9", "transition", "middle_of:", "left_of:-1"],
    "lanes:forward": ["-1", "500"],
    "bridge": ["\x7f"],
    "junction": ["roundabout", "circular", "spaghetti"],
}


@pytest.mark.parametrize(
    ("key", "value"), [(key, value) for key, values in STRANGE_TAGS.items() for value in values]
)
def test_strange_values_do_no_harm(tmp_path: Path, key: str, value: str) -> None:
    sketch = star([0.0, 120.0, 240.0])
    sketch.node(9, 0.0, -120.0)
    sketch.road(200, [1, 9], "Strange", **{key: value})
    (world,) = build_all(file_of(tmp_path, sketch)).worlds
    assert world.lanes
    assert all(lane.width_m.value > 0.0 for lane in world.lanes)
    assert sum(len(road.lane_ids) for road in world.roads) < 100
