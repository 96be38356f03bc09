"""Ground and roads of a World with heights in SDFormat: meshes beside the file, one a colour.

Heightmaps take images of 2^n + 1 pixels and 256 heights in Gazebo Classic; meshes are exact.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import numpy as np

from foretwin.contracts.arrays import Array
from foretwin.contracts.world import StopLine, World
from foretwin.geometry.polyline import left_of, unit
from foretwin.geometry.world_heights import WorldHeights
from foretwin.world_gen.export import solids
from foretwin.world_gen.export.sdformat_shapes import shaped
from foretwin.world_gen.export.solids import Rgba
from foretwin.world_gen.export.terrain import Terrain, draped, ground_mesh, road_mesh, write_obj
from foretwin.world_gen.export.xml_tree import Element, child

_Outline = tuple[Array, tuple[Array, ...]]


class MeshModel(NamedTuple):
    """What has one colour, and whether cars drive on it or run into it."""

    name: str
    mesh: Terrain
    rgba: Rgba
    solid: bool = False


def add_hills(made: Element, world: World, hills: WorldHeights, path: Path) -> None:
    """Write the meshes of a World beside its file `path`, and add models that name them."""
    for layer in _layers(world, hills):
        add_mesh_model(made, layer, world, path)


def add_mesh_model(made: Element, layer: MeshModel, world: World, path: Path) -> None:
    """Write a mesh, unless it is empty, beside the World's file, and add a model that names it."""
    if not len(layer.mesh.triangles):
        return
    file = path.with_name(f"{path.stem}.{layer.name}.obj")
    write_obj(layer.mesh, file, world.attribution)
    model = child(made, "model", name=layer.name)
    child(model, "static", "1")
    link = child(model, "link", name="link")
    uri = [("uri", file.name)]
    if layer.solid:
        shaped(child(link, "collision", name=f"{layer.name}.collision"), "mesh", uri)
    shaped(child(link, "visual", name=layer.name), "mesh", uri, rgba=layer.rgba)


def _layers(world: World, hills: WorldHeights) -> Iterator[MeshModel]:
    yield MeshModel("ground", ground_mesh(world, hills), solids.GROUND, True)
    road = road_mesh(world, hills, above_m=solids.ROAD_TOP_M)
    yield MeshModel("road", road, solids.ROAD, True)
    walks = [(area.outline, area.holes) for area in world.sidewalks]
    walked = draped(walks, hills, above_m=solids.SIDEWALK_TOP_M)
    yield MeshModel("sidewalks", walked, solids.SIDEWALK)
    for solid, name in ((True, "mounds"), (False, "islands")):
        mine = [(i.outline, i.holes) for i in world.islands if solids.stops_cars(i) == solid]
        top = draped(mine, hills, above_m=solids.island_height_m(solid=solid))
        yield MeshModel(name, top, solids.ISLAND, solid)
    lines = [_stripe(line.ends, wide) for line, wide in _painted(world)]
    paint = draped(lines, hills, above_m=solids.MARKING_TOP_M)
    yield MeshModel("markings", paint, solids.PAINT)
    stripes = [_stripe(c.line, c.width_m.value) for c in world.crossings if _long(c.line)]
    crossed = draped(stripes, hills, above_m=solids.MARKING_TOP_M)
    yield MeshModel("crossings", crossed, solids.CROSSING)


def _painted(world: World) -> Iterator[tuple[StopLine, float]]:
    for line in world.stop_lines:
        if line.control.value != "none" and _long(line.ends):
            yields = line.control.value == "give_way"
            yield line, solids.YIELD_LINE_M if yields else solids.STOP_LINE_M


def _long(ends: Array) -> bool:
    return float(np.hypot(*(ends[1] - ends[0]))) >= solids.SHORTEST_STRIPE_M


def _stripe(ends: Array, width_m: float) -> _Outline:
    """Return the outline of a stripe about a line (2, 2)."""
    aside = left_of(unit(ends[1] - ends[0])) * (width_m / 2.0)
    return np.array([ends[0] - aside, ends[1] - aside, ends[1] + aside, ends[0] + aside]), ()
