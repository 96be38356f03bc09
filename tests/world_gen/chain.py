"""The whole way from a map file to models that compile, as every junction goes it."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

from foretwin.contracts.world import World
from foretwin.world_gen.build import build_world
from foretwin.world_gen.export.mjcf import world_spec
from foretwin.world_gen.junctions.find_intersections import find_intersections
from foretwin.world_gen.junctions.map_index import index_map
from foretwin.world_gen.osm.osm_map import OsmMap
from foretwin.world_gen.osm.read_osm import read_map
from foretwin.world_gen.roads.build_graph import build_road_graph


class Built(NamedTuple):
    """A map and the Worlds of its junctions."""

    osm: OsmMap
    worlds: tuple[World, ...]
    index_notes: tuple[str, ...]

    @property
    def notes(self) -> str:
        """Everything that was said, line by line."""
        return "\n".join(
            [*self.osm.notes, *self.index_notes, *(note for w in self.worlds for note in w.notes)]
        )


def build_all(path: Path, *, most: int = 20, radius_m: float = 100.0) -> Built:
    """Build and compile the Worlds of a map's first `most` junctions."""
    osm = read_map(path)
    graph = build_road_graph(osm)
    junctions = find_intersections(osm, graph)
    index = index_map(osm, graph, junctions)
    worlds = []
    for junction in sorted(junctions, key=lambda j: j.summary.id)[:most]:
        world = build_world(osm, graph, junction, radius_m=radius_m, index=index)
        world_spec(world).compile()
        worlds.append(world)
    return Built(osm, tuple(worlds), index.buildings.notes)
