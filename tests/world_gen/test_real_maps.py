"""Real maps: the junctions that a real car passed, and what the maps' tags say there is."""

from __future__ import annotations

import collections
import time
from pathlib import Path

import numpy as np
import osmium
import pytest

from foretwin.contracts.frames import geo_from_ecef, local_from_geo
from foretwin.world_gen.junctions.find_intersections import find_intersections
from foretwin.world_gen.junctions.intersections import Junction
from foretwin.world_gen.osm.osm_map import OsmMap
from foretwin.world_gen.osm.read_osm import read_map
from foretwin.world_gen.roads.build_graph import build_road_graph
from foretwin.world_gen.roads.road_classes import CAR_CLASSES
from foretwin.world_gen.roads.road_graph import RoadGraph

pytestmark = pytest.mark.real_data

MAPS = {
    "berlin-mitte": "osm-berlin-mitte/berlin-mitte.osm",
    "moritzplatz": "osm-berlin-moritzplatz/berlin-moritzplatz.osm",
    "kingsway": "osm-kingsway/kingsway_junction.osm",
    "monaco": "osm-monaco/monaco.osm.gz",
    "badhersfeld": "osm-badhersfeld/badhersfeld.osm.xml.gz",
    "liechtenstein": "osm-liechtenstein/liechtenstein-latest.osm.pbf",
}
ROUNDABOUTS = {"moritzplatz": 1, "monaco": 10, "badhersfeld": 7, "liechtenstein": 15}


@pytest.fixture(scope="module", params=list(MAPS))
def found(
    request: pytest.FixtureRequest, data_dir: Path
) -> tuple[str, Path, OsmMap, RoadGraph, tuple[Junction, ...]]:
    path = data_dir / MAPS[request.param]
    osm = read_map(path)
    graph = build_road_graph(osm)
    return request.param, path, osm, graph, find_intersections(osm, graph)


Found = tuple[str, Path, OsmMap, RoadGraph, tuple[Junction, ...]]


def tagged_rings(path: Path) -> list[set[int]]:
    """Return the groups of nodes joined by ways tagged as roundabouts, read without our reader."""
    rings: list[set[int]] = []
    for way in osmium.FileProcessor(str(path), osmium.osm.WAY):
        tags = way.tags
        if (
            tags.get("junction") == "roundabout"
            and tags.get("highway") in CAR_CLASSES
            and tags.get("area") != "yes"
        ):
            nodes = {node.ref for node in way.nodes}
            for ring in [ring for ring in rings if ring & nodes]:
                nodes |= ring
                rings.remove(ring)
            rings.append(nodes)
    return rings


def test_every_tagged_roundabout_is_found_and_none_invented(found: Found) -> None:
    name, path, _, _, junctions = found
    rings = tagged_rings(path)
    ours = [junction for junction in junctions if junction.summary.kind == "roundabout"]
    assert len(ours) == len(rings) == ROUNDABOUTS.get(name, 0)
    for ring in rings:
        holders = [junction for junction in ours if ring & junction.nodes]
        assert len(holders) == 1
        assert int(holders[0].summary.id[1:]) in ring


def test_junctions_are_sound(found: Found) -> None:
    name, _, osm, graph, junctions = found
    assert junctions
    ids = [junction.summary.id for junction in junctions]
    assert ids == sorted(set(ids))
    counted = collections.Counter(node for junction in junctions for node in junction.nodes)
    assert max(counted.values()) == 1
    side = "left" if name == "kingsway" else "right"
    for junction in junctions:
        summary = junction.summary
        assert summary.driving_side == side
        assert summary.arms == len(junction.arms)
        if summary.kind not in ("roundabout", "circular", "mini_roundabout"):
            assert summary.arms >= 3, summary
        assert set(summary.osm_nodes) == junction.nodes
        assert junction.radius_m < 120.0, summary
        centre = local_from_geo(osm.frame, summary.lat, summary.lon)
        assert np.abs(centre - junction.centre_xy_m).max() < 0.02
        for arm in junction.arms:
            for item in arm.outward:
                assert item.start_node in junction.nodes
                assert item.edge.car
                assert item.edge.index not in junction.inner
        for index in junction.inner:
            edge = graph.edges[index]
            assert {edge.start_node, edge.end_node} <= junction.nodes


def test_signals_at_junctions(found: Found) -> None:
    """Kingsway and the Berlin maps show lights on most of their main crossings."""
    name, _, _, _, junctions = found
    signalled = sum(junction.summary.control == "signals" for junction in junctions)
    at_least = {"berlin-mitte": 8, "moritzplatz": 3, "kingsway": 1, "badhersfeld": 15, "monaco": 3}
    assert signalled >= at_least.get(name, 1)


def drive_xy_m(data_dir: Path, osm: OsmMap, end_s: float) -> np.ndarray:
    text = data_dir / "drive-berlin-gendarmenmarkt" / "Berlin_Gendarmenmarkt_GT.txt"
    rows = [line.split()[1:5] for line in text.read_text().splitlines() if "point3" in line]
    samples = np.array(rows, dtype=np.float64)
    samples = samples[samples[:, 0] - samples[0, 0] <= end_s]
    geo = geo_from_ecef(samples[:, 1:])
    return local_from_geo(osm.frame, geo[:, 0], geo[:, 1])


def test_the_berlin_drive_passes_exactly_its_five_junctions(data_dir: Path) -> None:
    osm = read_map(data_dir / MAPS["berlin-mitte"])
    junctions = find_intersections(osm, build_road_graph(osm))
    path = drive_xy_m(data_dir, osm, 262.0)
    passed = {}
    for junction in junctions:
        distance_m = np.hypot(*(path - junction.centre_xy_m).T)
        if distance_m.min() <= 15.0:
            passed[junction.summary.name] = (
                round(float(distance_m.argmin()) * 0.2),
                junction.summary.lat,
                junction.summary.lon,
            )
    times = {name: at_s for name, (at_s, _, _) in passed.items()}
    assert times == {
        "Kronenstraße \u00d7 Markgrafenstraße": pytest.approx(39, abs=3),
        "Charlottenstraße \u00d7 Kronenstraße": pytest.approx(65, abs=3),
        "Glinkastraße \u00d7 Kronenstraße \u00d7 Mauerstraße": pytest.approx(152, abs=3),
        "Glinkastraße \u00d7 Mohrenstraße": pytest.approx(165, abs=3),
        "Charlottenstraße \u00d7 Mohrenstraße": pytest.approx(248, abs=3),
    }
    _, lat, lon = passed["Kronenstraße \u00d7 Markgrafenstraße"]
    assert (lat, lon) == (pytest.approx(52.51147, abs=5e-5), pytest.approx(13.3936, abs=5e-5))


def test_no_junction_where_mohrenstrasse_only_parts(data_dir: Path) -> None:
    osm = read_map(data_dir / MAPS["berlin-mitte"])
    junctions = find_intersections(osm, build_road_graph(osm))
    for lat, lon in ((52.51204, 13.3888), (52.51212, 13.3901), (52.5112, 13.3896)):
        place = local_from_geo(osm.frame, lat, lon)
        assert min(np.hypot(*(j.centre_xy_m - place)) for j in junctions) > 40.0


def test_berlin_is_read_and_searched_in_a_moment(data_dir: Path) -> None:
    """The look-ahead builds on this; 0.3 s on a quiet machine, the bound allows for a busy one."""
    began = time.process_time()
    osm = read_map(data_dir / MAPS["berlin-mitte"])
    find_intersections(osm, build_road_graph(osm))
    assert time.process_time() - began < 2.0


@pytest.mark.judge
def test_testfeld_has_all_its_roundabouts(data_dir: Path) -> None:
    path = data_dir / "osm-testfeld-nds" / "TestfeldNDS_main_roads.osm.xml.gz"
    osm = read_map(path)
    junctions = find_intersections(osm, build_road_graph(osm))
    kinds = collections.Counter(junction.summary.kind for junction in junctions)
    assert kinds["roundabout"] == len(tagged_rings(path)) == 98
