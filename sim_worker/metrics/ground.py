"""The ground that may be driven on, as a look-up that thousands of points ask at once."""

from __future__ import annotations

import numpy as np
import shapely

from foretwin.contracts.arrays import Array, Flags, Indices
from foretwin.contracts.world import Area, World
from foretwin.world_gen.extent import extent_of

TOLERANCE_M = 0.3
"""Beyond the edge this much is no violation: nuPlan, drivable_area_compliance."""
_CELL_M = 0.5
_UNKNOWN, _OUTSIDE, _INSIDE, _EDGE = -1, 0, 1, 2
_MARGIN_M = 2.0


class DrivableGround:
    """Road surface and junction areas of a World, without its islands, `TOLERANCE_M` wider.

    `wider_m` (A,) is how much wider still each of `paved_areas` is: what is not known of its edges.
    Cells of half a metre are looked at once, when a point first falls into them; points of cells
    that an edge passes through are tested exactly. Answers do not depend on what was asked before.
    """

    def __init__(self, world: World, *, wider_m: Array | None = None) -> None:
        areas = paved_areas(world)
        most_m = 0.0 if wider_m is None or not len(wider_m) else float(wider_m.max())
        polygons = [polygon_of(area) for area in areas]
        if wider_m is not None:
            polygons = list(shapely.buffer(polygons, wider_m))
        paved = shapely.union_all(polygons).buffer(TOLERANCE_M)
        islands = shapely.union_all([polygon_of(area) for area in world.islands])
        self.surface = shapely.difference(paved, islands.buffer(-TOLERANCE_M - most_m))
        shapely.prepare(self.surface)
        west, south, east, north = self.surface.bounds if areas else (0.0, 0.0, 0.0, 0.0)
        self._origin = np.array([west, south]) - _MARGIN_M
        size = np.array([east - west, north - south]) + 2.0 * _MARGIN_M
        self._columns, self._rows = np.ceil(size / _CELL_M).astype(int) + 1
        self._cells = np.full(self._columns * self._rows, _UNKNOWN, dtype=np.int8)
        self.extent = extent_of(world)

    def contains(self, x_m: Array, y_m: Array) -> Flags:
        """Return (…) whether points (…) in the World's frame lie on drivable ground."""
        column = ((x_m - self._origin[0]) * (1.0 / _CELL_M)).astype(np.intp)
        row = ((y_m - self._origin[1]) * (1.0 / _CELL_M)).astype(np.intp)
        within = (x_m >= self._origin[0]) & (y_m >= self._origin[1])
        within &= (column < self._columns) & (row < self._rows)
        cell = np.where(within, row * self._columns + column, 0)
        kind = self._cells[cell]
        if (kind == _UNKNOWN).any():
            self._look(np.unique(cell[kind == _UNKNOWN]))
            kind = self._cells[cell]
        inside = (kind == _INSIDE) & within
        edge = (kind == _EDGE) & within
        if edge.any():
            inside[edge] = shapely.intersects_xy(self.surface, x_m[edge], y_m[edge])
        return np.asarray(inside)

    def _look(self, cells: Indices) -> None:
        row, column = np.divmod(cells, self._columns)
        west = self._origin[0] + column * _CELL_M
        south = self._origin[1] + row * _CELL_M
        boxes = shapely.box(west, south, west + _CELL_M, south + _CELL_M)
        touched = shapely.intersects(self.surface, boxes)
        kind = np.where(touched, _EDGE, _OUTSIDE).astype(np.int8)
        kind[touched] = np.where(
            shapely.contains_properly(self.surface, boxes[touched]), _INSIDE, _EDGE
        )
        self._cells[cells] = kind


def paved_areas(world: World) -> list[Area]:
    """Return the road surface and the junction areas of a World."""
    return [*world.road_surface, *(j.area for j in world.junctions if j.area is not None)]


def polygon_of(area: Area) -> shapely.Polygon:
    """Return an area as what shapely computes with, mended where its outline crosses itself."""
    polygon = shapely.Polygon(area.outline, area.holes)
    return polygon if polygon.is_valid else polygon.buffer(0.0)
