"""Ground and roads of a World with heights as triangles, for simulators that drive on them."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import NamedTuple

import numpy as np
import shapely

from foretwin.contracts.arrays import Array, Indices
from foretwin.contracts.world import Connection, Lane, World
from foretwin.geometry.polyline import left_of, tangents
from foretwin.geometry.triangles import joined, triangulated, upward
from foretwin.geometry.world_heights import WorldHeights
from foretwin.world_gen.export.xml_tree import in_comment

_SLIVER_M2 = 1e-3
"""Twice the area of triangles that are left out: they would stand upright."""
_ASIDE_M = 0.75
"""Paved ground reaches so far beyond lanes."""
EDGE_M = 5.0
"""Outlines are cut into pieces no longer: roads bend over hills."""
BELOW_ROAD_M = 0.3
"""The raster of the ground lies so far below the roads on it, so that it nowhere looks through."""


class Terrain(NamedTuple):
    """Points (N, 3) in the World's frame and triangles (M, 3), seen from above."""

    points: Array
    triangles: Indices


def ground_mesh(world: World, hills: WorldHeights) -> Terrain:
    """Return the open ground, which makes room for what lies on it."""
    elevation = hills.elevation
    rows, columns = elevation.ground_m.shape
    west, south = elevation.ground_from_m
    step = elevation.ground_step_m
    x, y = np.meshgrid(west + step * np.arange(columns), south + step * np.arange(rows))
    points = np.column_stack([x.ravel(), y.ravel(), elevation.ground_m.ravel()])
    paved = shapely.union_all([_polygon(a.outline, a.holes) for a in world.road_surface])
    near = shapely.dwithin(paved, shapely.points(points[:, :2]), 1.5 * step)
    points[near, 2] -= BELOW_ROAD_M
    corner = (np.arange(rows - 1)[:, None] * columns + np.arange(columns - 1)).ravel()
    lower = np.column_stack([corner, corner + 1, corner + columns + 1])
    upper = np.column_stack([corner, corner + columns + 1, corner + columns])
    return Terrain(points, np.concatenate([lower, upper]))


def road_mesh(world: World, hills: WorldHeights, *, above_m: float) -> Terrain:
    """Return what is driven on: on the ground the paved areas, over and under it lanes alone.

    Paved areas do not say whether they are a bridge's: what only lanes of other layers cover is.
    """
    parts: list[Lane | Connection] = [*world.lanes, *world.connections]
    spans = [part for part in parts if part.layer]
    paved = [_polygon(area.outline, area.holes) for area in world.road_surface]
    if spans:
        grounded = [_ribbon(part, _ASIDE_M) for part in parts if not part.layer]
        lifted = shapely.union_all([_ribbon(part, _ASIDE_M) for part in spans])
        lifted = lifted.difference(shapely.union_all(grounded))
        paved = [area.difference(lifted) for area in paved]
    meshes = [_draped(paved, hills, above_m=above_m)]
    meshes += [_strip(part, hills, above_m=above_m) for part in spans]
    first = np.cumsum([0, *(len(mesh.points) for mesh in meshes)])
    return Terrain(
        np.concatenate([mesh.points for mesh in meshes]),
        np.concatenate([mesh.triangles + i for mesh, i in zip(meshes, first, strict=False)]),
    )


def _ribbon(part: Lane | Connection, aside_m: float) -> shapely.Geometry:
    half_m = part.width_m.value / 2.0 + aside_m
    return shapely.LineString(part.centerline).buffer(half_m, cap_style="flat")


def _strip(part: Lane | Connection, hills: WorldHeights, *, above_m: float) -> Terrain:
    """Return a lane as a strip of its own at its own height."""
    line = shapely.get_coordinates(shapely.segmentize(shapely.LineString(part.centerline), EDGE_M))
    aside = left_of(tangents(line)) * (part.width_m.value / 2.0)
    high = hills.along(part, line) + above_m
    points = np.column_stack([np.concatenate([line + aside, line - aside]), np.tile(high, 2)])
    count = len(line)
    left = np.arange(count - 1)
    right = left + count
    one = np.column_stack([left, right, right + 1])
    other = np.column_stack([left, right + 1, left + 1])
    faces = upward(points, np.concatenate([one, other]), sliver_m2=_SLIVER_M2)
    return Terrain(points, faces)


def draped(
    outlines: Iterable[tuple[Array, tuple[Array, ...]]], hills: WorldHeights, *, above_m: float
) -> Terrain:
    """Return areas (outline and holes) as they lie on the ground, lifted by `above_m`."""
    return _draped([_polygon(*outline) for outline in outlines], hills, above_m=above_m)


def _draped(areas: list[shapely.Geometry], hills: WorldHeights, *, above_m: float) -> Terrain:
    if not areas:
        return Terrain(np.zeros((0, 3)), np.zeros((0, 3), dtype=np.intp))
    flat = joined(triangulated(np.array(areas)).corners_m, sliver_m2=_SLIVER_M2)
    high = hills.surface_at(flat.xy_m) + above_m
    return Terrain(np.column_stack([flat.xy_m, high]), flat.triangles)


def _polygon(outline: Array, holes: tuple[Array, ...] = ()) -> shapely.Geometry:
    shape = shapely.Polygon(outline, list(holes))
    return shapely.segmentize(shape if shape.is_valid else shapely.make_valid(shape), EDGE_M)


def write_obj(mesh: Terrain, path: Path, attribution: str) -> None:
    """Write triangles as Wavefront OBJ, which Gazebo and most programs read; z is up."""
    lines = [f"# {in_comment(attribution)}"]
    lines += [f"v {x:.3f} {y:.3f} {z:.3f}" for x, y, z in mesh.points.tolist()]
    lines += [f"f {a} {b} {c}" for a, b, c in (mesh.triangles + 1).tolist()]
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
