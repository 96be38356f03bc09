"""`python -m tests.benchmarks.map_to_world MAP FOLDER [network]` makes a World of a whole map.

What is held against SUMO's netconvert: from the file to lanes, connections, right of way and
lights, written in the form that every room of foretwin loads. That is the `network`, which is what
netconvert makes; without the word, paved ground, kerbs, sidewalks and buildings come on top.
"""

from __future__ import annotations

import sys
from pathlib import Path

from foretwin.contracts.world import World
from foretwin.orchestrator.worlds.opening import open_map
from foretwin.world_gen.build import build_region
from foretwin.world_gen.junctions.map_index import index_map
from foretwin.world_gen.world_store import WorldStore

NETWORK = "network"


def make_world(map_file: Path, folder: Path, *, ground: bool = True) -> World:
    """Build the World of all roads of a map and save it in `folder`."""
    opened = open_map(map_file)
    index = index_map(opened.osm, opened.graph, opened.junctions)
    world = build_region(opened.osm, opened.graph, opened.osm.bounds, index=index, ground=ground)
    WorldStore(folder).save(world)
    return world


if __name__ == "__main__":
    make_world(Path(sys.argv[1]), Path(sys.argv[2]), ground=sys.argv[3:] != [NETWORK])
