"""The parts that SDFormat files are made of: links with named shapes, extrusions without holes."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Sequence

import numpy as np
import shapely
from shapely.geometry import Polygon

from foretwin.contracts.arrays import Array
from foretwin.world_gen.export.solids import Rgba
from foretwin.world_gen.export.xml_tree import Element, child, leaves
from foretwin.world_gen.polygon_areas import GRID_M

RECTANGLE_M = 0.05
"""So far a corner may lie from a rectangle's."""
LEAST_AREA_M2 = 0.05
Size = tuple[float, float, float]
Sizes = Sequence[tuple[str, str]]
"""What describes a shape, such as its radius and its length."""
_MANY_POINTS = 400
"""Outlines with more are halved: triangulating grows faster than the number of points."""


def numbers(*values: float, digits: int = 3) -> str:
    """Return numbers as SDFormat has them, without needless zeros and never as -0."""
    return " ".join(
        f"{round(float(v), digits) + 0.0:.{digits}f}".rstrip("0").rstrip(".") for v in values
    )


def pose(
    parent: Element, x: float = 0.0, y: float = 0.0, z: float = 0.0, yaw_rad: float = 0.0
) -> None:
    """Place the parent element, metres and radians."""
    if x or y or z or yaw_rad:
        child(parent, "pose", f"{numbers(x, y, z)} 0 0 {numbers(yaw_rad, digits=6)}")


class StaticLink:
    """One link of a model that never moves, to which shapes are added under names of their own."""

    def __init__(self, world: Element, name: str) -> None:
        model = child(world, "model", name=name)
        child(model, "static", "1")
        self._link = child(model, "link", name="link")
        self._names: set[str] = set()

    def box(
        self, name: str, at: Sequence[float], size_m: Size, rgba: Rgba, *, solid: bool = False
    ) -> None:
        """Add a box of (length, width, height) around its centre (x, y, z and yaw)."""
        self._add(name, "box", [("size", numbers(*size_m))], at, rgba, solid=solid)

    def cylinder(
        self, name: str, at: Sequence[float], radius_m: float, height_m: float, rgba: Rgba
    ) -> None:
        """Add an upright cylinder around its centre (x, y, z) that is only seen."""
        size = [("radius", numbers(radius_m)), ("length", numbers(height_m))]
        self._add(name, "cylinder", size, at, rgba, solid=False)

    def prism(
        self, name: str, ring: Array, span_m: tuple[float, float], rgba: Rgba, *, solid: bool
    ) -> None:
        """Add an outline (N, 2) from one height to another, as a box where it is a rectangle."""
        low_m, high_m = span_m
        rectangle = rectangle_of(ring)
        if rectangle is not None:
            x, y, length, width, yaw = rectangle
            at, size = (x, y, (low_m + high_m) / 2, yaw), (length, width, high_m - low_m)
            self.box(name, at, size, rgba, solid=solid)
            return
        outline = [("point", numbers(x, y)) for x, y in ring.tolist()]
        outline.append(("height", numbers(high_m - low_m)))
        self._add(name, "polyline", outline, (0.0, 0.0, low_m), rgba, solid=solid)

    def _add(
        self, name: str, shape: str, size: Sizes, at: Sequence[float], rgba: Rgba, *, solid: bool
    ) -> None:
        name = self._free(name)
        if solid:
            shaped(child(self._link, "collision", name=f"{name}.collision"), shape, size, at)
        shaped(child(self._link, "visual", name=name), shape, size, at, rgba)

    def _free(self, wanted: str) -> str:
        """Return a name that SDFormat allows and that no other shape of the link has."""
        plain = re.sub(r"[^\w.-]+", "_", wanted, flags=re.ASCII).strip("_") or "shape"
        name, count = plain, 1
        while name in self._names:
            count += 1
            name = f"{plain}_{count}"
        self._names.add(name)
        return name


def shaped(
    part: Element, shape: str, size: Sizes, at: Sequence[float] = (), rgba: Rgba | None = None
) -> None:
    """Give a collision or visual its shape, its place (x, y, z and yaw) and, if any, one colour.

    The fourth number of a colour is opacity.
    """
    pose(part, *at)
    leaves(child(child(part, "geometry"), shape), size)
    if rgba is not None:
        if rgba[3] < 1.0:
            child(part, "transparency", numbers(1.0 - rgba[3]))
        leaves(child(part, "material"), {"ambient": numbers(*rgba), "diffuse": numbers(*rgba)})


def rectangle_of(ring: Array) -> tuple[float, float, float, float, float] | None:
    """Return x, y, length, width, yaw of a ring (4, 2) that is a rectangle, else None."""
    if len(ring) != 4:
        return None
    sides = np.roll(ring, -1, axis=0) - ring
    middle = ring.mean(axis=0)
    if np.hypot(*(ring[0] + ring[2] - ring[1] - ring[3])) > RECTANGLE_M:
        return None
    length, width = float(np.hypot(*sides[0])), float(np.hypot(*sides[1]))
    skew = abs(float(sides[0] @ sides[1]))
    if skew > RECTANGLE_M * max(length, width) or min(length, width) < 0.01:
        return None
    yaw = math.atan2(sides[0][1], sides[0][0])
    return float(middle[0]), float(middle[1]), length, width, yaw


def extrusions(
    outline: Array, holes: Iterable[Array] = (), *, tolerance_m: float = 0.0
) -> list[Array]:
    """Return rings (N, 2) without holes that together cover a polygon.

    SDFormat 1.7 has one outline per extrusion, so polygons are cut through their holes. Outlines
    are simplified by no more than `tolerance_m`.
    """
    shape: shapely.Geometry = Polygon(outline, list(holes))
    if tolerance_m:
        shape = shape.simplify(tolerance_m)
    if not shape.is_valid:
        shape = shapely.make_valid(shape)
    pieces = [
        piece
        for part in shapely.get_parts(shape)
        if isinstance(part, Polygon)
        for piece in _without_holes(part)
    ]
    # On the grid, as they are written, outlines in the file are valid.
    return [
        shapely.get_coordinates(shapely.orient_polygons(part).exterior)[:-1]
        for part in shapely.get_parts(shapely.set_precision(pieces, GRID_M))
        if isinstance(part, Polygon) and part.area > LEAST_AREA_M2
    ]


def _without_holes(polygon: Polygon) -> list[Polygon]:
    if polygon.area < LEAST_AREA_M2:
        return []
    if not polygon.interiors and len(polygon.exterior.coords) <= _MANY_POINTS:
        return [polygon]
    west, south, east, north = polygon.bounds
    across = 0 if east - west >= north - south else 1
    inside = [Polygon(hole).representative_point().coords[0][across] for hole in polygon.interiors]
    at = (west + east) / 2 if across == 0 else (south + north) / 2
    if inside:
        at = sorted(inside)[len(inside) // 2]
    if across == 0:
        halves = shapely.box(west, south, at, north), shapely.box(at, south, east, north)
    else:
        halves = shapely.box(west, south, east, at), shapely.box(west, at, east, north)
    parts = shapely.get_parts([polygon.intersection(half) for half in halves])
    return [piece for p in parts if isinstance(p, Polygon) for piece in _without_holes(p)]
