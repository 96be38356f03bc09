"""A foreign count of rings and traffic lights, straight from the maps, finds the same as ours."""

from __future__ import annotations

import json
import os
import random
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

from foretwin.contracts.frames import local_from_geo
from foretwin.contracts.world import World
from foretwin.world_gen.build import build_region, build_world
from foretwin.world_gen.junctions.find_intersections import find_intersections
from foretwin.world_gen.junctions.intersections import Junction
from foretwin.world_gen.junctions.map_index import index_map
from foretwin.world_gen.osm.osm_map import LatLonBounds, OsmMap
from foretwin.world_gen.osm.read_osm import read_map
from foretwin.world_gen.roads.build_graph import build_road_graph
from foretwin.world_gen.roads.road_graph import RoadGraph
from tests.world_gen.test_real_maps import MAPS
from tests.world_gen.traffic_lights import TrafficLight, traffic_lights

pytestmark = [pytest.mark.real_data, pytest.mark.judge]

TESTFELD = "osm-testfeld-nds/TestfeldNDS_main_roads.osm.xml.gz"
LIGHTS_ASKED = 160
"""Of larger maps a fixed sample, drawn by chance."""
BETWEEN_JUNCTIONS = {
    "berlin-mitte": 7,
    "moritzplatz": 6,
    "kingsway": 2,
    "monaco": 1,
    "badhersfeld": 6,
    "liechtenstein": 3,
}
"""Lights that no junction of the extract explains, each looked at: half of them belong to
junctions that the extract's edge cuts off, the rest to tunnels, works, crossings on foot that the
map does not tag as such, and roads closed to cars."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Judged:
    """A map, what we found in it and what the judge counted."""

    name: str
    osm: OsmMap
    graph: RoadGraph
    junctions: tuple[Junction, ...]
    truth: dict[str, object]


@pytest.fixture(scope="module", params=[*MAPS, "testfeld"])
def judged(request: pytest.FixtureRequest, data_dir: Path) -> Judged:
    folder = os.environ.get("FORETWIN_JUDGES")
    if not folder:
        pytest.skip("FORETWIN_JUDGES is not set: no osm_truth.py to count what a map holds")
    path = data_dir / MAPS.get(request.param, TESTFELD)
    done = subprocess.run(
        [sys.executable, str(Path(folder) / "osm_truth.py"), str(path)],
        capture_output=True,
        text=True,
        check=True,
        timeout=240.0,
    )
    osm = read_map(path)
    graph = build_road_graph(osm)
    return Judged(
        name=request.param,
        osm=osm,
        graph=graph,
        junctions=find_intersections(osm, graph),
        truth=json.loads(done.stdout),
    )


def test_all_tagged_rings_are_found_and_none_invented(judged: Judged) -> None:
    ours = [j for j in judged.junctions if j.summary.kind == "roundabout"]
    assert len(ours) == judged.truth["roundabout_rings"]
    centres = judged.truth["ring_centres_lat_lon"]
    assert isinstance(centres, list)
    assert len(centres) == len(ours)
    for lat, lon in centres:
        place = local_from_geo(judged.graph.frame, lat, lon)
        away_m = [float(np.hypot(*(j.centre_xy_m - place))) for j in ours]
        nearest = ours[int(np.argmin(away_m))]
        # The judge takes the mean of the nodes, we the middle of the line.
        assert min(away_m) < max(5.0, nearest.radius_m)


def test_all_lights_on_car_roads_are_accounted_for(judged: Judged) -> None:
    lights = traffic_lights(judged.osm, judged.junctions)
    assert len(lights) == judged.truth["signals_on_car_roads"]
    roles = [light.role for light in lights]
    if judged.name in BETWEEN_JUNCTIONS:
        assert roles.count("road") == BETWEEN_JUNCTIONS[judged.name]


def test_every_light_governs_lanes_in_some_world(judged: Judged) -> None:
    index = index_map(judged.osm, judged.graph, judged.junctions)
    lights = list(traffic_lights(judged.osm, judged.junctions))
    if len(lights) > LIGHTS_ASKED:
        lights = random.Random(3).sample(lights, LIGHTS_ASKED)
    by_id = {junction.summary.id: junction for junction in judged.junctions}
    worlds: dict[str, World] = {}
    lost = []
    for light in lights:
        for key in light.junction_ids:
            if key not in worlds:
                worlds[key] = build_world(judged.osm, judged.graph, by_id[key], index=index)
        near = [worlds[key] for key in light.junction_ids]
        if not near and _reached(light, judged.graph):
            lat, lon = judged.osm.locations[light.osm_node]
            box = LatLonBounds(lat - 0.0012, lon - 0.0012, lat + 0.0012, lon + 0.0012)
            near = [build_region(judged.osm, judged.graph, box, index=index)]
        lost += [(light, world.intersection.id) for world in near if not _governs(light, world)]
    assert not lost


def _reached(light: TrafficLight, graph: RoadGraph) -> bool:
    """Tell whether cars come to a light: not where the extract cuts off a one-way road before."""
    for edge in graph.edges:
        if edge.car and light.osm_node in edge.node_ids:
            at = edge.node_ids.index(light.osm_node)
            if (edge.forward and at > 0) or (edge.backward and at < len(edge.node_ids) - 1):
                return True
    return False


def _governs(light: TrafficLight, world: World) -> bool:
    return any(
        light.osm_node in (signal.osm_node, *signal.osm_nodes) and signal.lane_ids
        for signal in world.signals
    )
