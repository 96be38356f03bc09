"""The drawn town: reproducible, plainly marked, and made of what a newcomer should see."""

from __future__ import annotations

import json
from itertools import combinations
from pathlib import Path

import numpy as np
import osmium
import pytest
from shapely.geometry import LineString, Polygon

from foretwin.contracts.frames import local_from_geo
from foretwin.orchestrator.embedded import MAP_FILE, ROUTE_FILE
from foretwin.orchestrator.embedded.draw_town import NOTE, ORIGIN, RING_CENTRE, write
from foretwin.world_gen.junctions.find_intersections import find_intersections
from foretwin.world_gen.osm.read_osm import read_map
from foretwin.world_gen.roads.build_graph import build_road_graph

COVERS = (
    "foretwin.orchestrator.embedded",
    "foretwin.orchestrator.embedded.draw_town",
)


class Town:
    """The embedded map as pyosmium reads it, in metres about its origin."""

    def __init__(self) -> None:
        self.node_tags: dict[int, dict[str, str]] = {}
        self.streets: list[tuple[dict[str, str], LineString]] = []
        self.buildings: list[tuple[dict[str, str], Polygon]] = []
        for thing in osmium.FileProcessor(str(MAP_FILE)).with_locations().with_areas():
            tags = {tag.k: tag.v for tag in thing.tags}
            if thing.is_node() and tags:
                self.node_tags[thing.id] = tags
            elif thing.is_way() and "highway" in tags:
                self.streets.append((tags, LineString(_metres(thing.nodes))))
            elif thing.is_area() and "building" in tags:
                (outer,) = thing.outer_rings()
                holes = [_metres(ring) for ring in thing.inner_rings(outer)]
                self.buildings.append((tags, Polygon(_metres(outer), holes)))


def _metres(nodes: osmium.osm.NodeRefList) -> np.ndarray:
    return local_from_geo(
        ORIGIN, np.array([n.lat for n in nodes]), np.array([n.lon for n in nodes])
    )


@pytest.fixture(scope="module")
def town() -> Town:
    return Town()


@pytest.fixture(scope="module")
def route() -> LineString:
    (feature,) = json.loads(ROUTE_FILE.read_text())["features"]
    lon_lat = np.array(feature["geometry"]["coordinates"])
    return LineString(local_from_geo(ORIGIN, lon_lat[:, 1], lon_lat[:, 0]))


def test_drawing_again_gives_the_same_files(tmp_path: Path) -> None:
    write(tmp_path)

    assert (tmp_path / MAP_FILE.name).read_bytes() == MAP_FILE.read_bytes()
    assert (tmp_path / ROUTE_FILE.name).read_bytes() == ROUTE_FILE.read_bytes()


def test_map_says_that_it_is_drawn(town: Town) -> None:
    head = MAP_FILE.read_text().splitlines()[1:3]
    notes = [tags["note"] for tags in town.node_tags.values() if "note" in tags]

    assert all(NOTE in line for line in head)
    assert notes == [NOTE]
    assert json.loads(ROUTE_FILE.read_text())["features"][0]["properties"]["note"] == NOTE


def test_town_has_a_ring_signals_a_stop_and_give_ways(town: Town) -> None:
    signs = [tags["highway"] for tags in town.node_tags.values() if "highway" in tags]
    rings = [line for tags, line in town.streets if tags.get("junction") == "roundabout"]

    assert signs.count("traffic_signals") == 4
    assert signs.count("stop") == 1
    assert signs.count("give_way") == 6
    assert signs.count("crossing") == 9
    assert len(rings) == 1
    assert rings[0].is_ring
    assert rings[0].length == pytest.approx(2 * np.pi * 15.0, rel=0.01)


def test_buildings_stand_apart_and_off_the_streets(town: Town) -> None:
    shapes = [shape for _, shape in town.buildings]
    heights = {
        "height" if "height" in tags else "levels" if "building:levels" in tags else "neither"
        for tags, _ in town.buildings
    }

    assert 40 <= len(shapes) <= 65
    assert heights == {"height", "levels", "neither"}
    assert sum(len(shape.interiors) for shape in shapes) == 1
    assert all(shape.is_valid for shape in shapes)
    assert not any(a.intersects(b) for a, b in combinations(shapes, 2))
    assert min(shape.distance(line) for shape in shapes for _, line in town.streets) > 9.0


def test_route_follows_the_streets_through_all_four_junctions(
    town: Town, route: LineString
) -> None:
    along = np.linspace(0.0, route.length, 500)
    off_street_m = [
        min(line.distance(route.interpolate(s)) for _, line in town.streets) for s in along
    ]

    assert 700.0 <= route.length <= 1000.0
    assert max(off_street_m) < 0.02
    for name in ("Mill Lane", "Abbey Road", "Lime Street East", "Orchard Lane"):
        arms = [line for tags, line in town.streets if tags.get("name") == name]
        assert min(arm.distance(route) for arm in arms) < 16.0, name


def test_junctions_come_out_as_drawn() -> None:
    osm = read_map(MAP_FILE)

    found = find_intersections(osm, build_road_graph(osm))

    assert {(j.summary.kind, j.summary.control, j.summary.arms) for j in found} == {
        ("roundabout", "roundabout", 4),
        ("t_junction", "stop", 3),
        ("crossing", "signals", 4),
        ("crossing", "give_way", 4),
    }
    assert len(found) == 4
    assert {j.summary.driving_side for j in found} == {"right"}
    (ring,) = (j.summary for j in found if j.summary.kind == "roundabout")
    centre = local_from_geo(ORIGIN, ring.lat, ring.lon)
    assert centre == pytest.approx(RING_CENTRE, abs=0.1)
