"""Sixty junctions of all extracts in the data folder, always the same, for the exports' judges."""

from __future__ import annotations

import hashlib
from collections import Counter
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import NamedTuple

from foretwin.contracts.world import World
from foretwin.world_gen.build import build_world
from foretwin.world_gen.junctions.find_intersections import find_intersections
from foretwin.world_gen.junctions.intersections import Junction
from foretwin.world_gen.junctions.map_index import index_map
from foretwin.world_gen.osm.read_osm import read_map
from foretwin.world_gen.roads.build_graph import build_road_graph

SEED = 20
QUOTA = {
    "osm-berlin-mitte/berlin-mitte.osm": 9,
    "osm-berlin-moritzplatz/berlin-moritzplatz.osm": 8,
    "osm-kingsway/kingsway_junction.osm": 5,
    "osm-badhersfeld/badhersfeld.osm.xml.gz": 11,
    "osm-monaco/monaco.osm.gz": 9,
    "osm-liechtenstein/liechtenstein-latest.osm.pbf": 10,
    "osm-testfeld-nds/TestfeldNDS_main_roads.osm.xml.gz": 8,
}
"""How many junctions of each extract are judged: 60 in all."""


class SampledWorld(NamedTuple):
    """A World of the sample; its name says extract and junction, and is fit for a file."""

    name: str
    world: World


def sample_worlds(data_dir: Path) -> Iterator[SampledWorld]:
    """Build the sample's Worlds one after another, each map read once and let go."""
    for file, count in QUOTA.items():
        osm = read_map(data_dir / file)
        graph = build_road_graph(osm)
        junctions = find_intersections(osm, graph)
        index = index_map(osm, graph, junctions)
        for junction in _drawn(junctions)[:count]:
            world = build_world(osm, graph, junction, index=index)
            yield SampledWorld(f"{Path(file).name.split('.')[0]}-{junction.summary.id}", world)


def _drawn(junctions: Iterable[Junction]) -> list[Junction]:
    """Return the junctions in the order in which they are drawn: one of each kind, then another."""
    seen: Counter[str] = Counter()
    turns = []
    for junction in sorted(junctions, key=_lot):
        kind = junction.summary.kind
        turns.append((seen[kind], _lot(junction), junction))
        seen[kind] += 1
    return [junction for _, _, junction in sorted(turns, key=lambda turn: turn[:2])]


def _lot(junction: Junction) -> str:
    # By hash and not by position: a junction more or less elsewhere leaves the others drawn.
    return hashlib.sha256(f"{SEED}:{junction.summary.id}".encode()).hexdigest()
