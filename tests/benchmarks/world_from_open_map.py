"""From a map in memory to a World and its compiled model, against only reading the map's ways."""

from __future__ import annotations

import os
from pathlib import Path

import osmium

from foretwin.orchestrator.embedded import MAP_FILE
from foretwin.world_gen.build import build_world
from foretwin.world_gen.export.mjcf import world_spec
from foretwin.world_gen.junctions.find_intersections import find_intersections
from foretwin.world_gen.junctions.map_index import index_map
from foretwin.world_gen.osm.read_osm import read_map
from foretwin.world_gen.roads.build_graph import build_road_graph
from tests.benchmarks.measuring import Measurement, cpu_minimum_s

REPEATS = 5
SAMPLE = 12


def measure() -> Measurement:
    """Return CPU seconds for one World and model, the mean over a sample of junctions.

    The map is that of Berlin-Mitte where FORETWIN_DATA names it, else the embedded one.
    """
    data = os.environ.get("FORETWIN_DATA")
    path = Path(data) / "osm-berlin-mitte" / "berlin-mitte.osm" if data else MAP_FILE
    osm = read_map(path)
    graph = build_road_graph(osm)
    junctions = find_intersections(osm, graph)
    index = index_map(osm, graph, junctions)
    sample = junctions[:: max(1, len(junctions) // SAMPLE)][:SAMPLE]

    def build_all() -> None:
        for junction in sample:
            world_spec(build_world(osm, graph, junction, index=index), visual=False).compile()

    built_s = cpu_minimum_s(build_all, repeats=REPEATS) / len(sample)
    return Measurement(built_s, "CPU s", cpu_minimum_s(lambda: _read_ways(path), repeats=REPEATS))


def _read_ways(path: Path) -> int:
    """Read every way with its nodes' places: the floor under anything made from the map."""
    entities = osmium.osm.NODE | osmium.osm.WAY
    ways = osmium.FileProcessor(str(path), entities).with_locations()
    return sum(
        len([(node.lat, node.lon) for node in way.nodes])
        for way in ways.with_filter(osmium.filter.EntityFilter(osmium.osm.WAY))
    )
