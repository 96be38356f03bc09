"""What stands between eyes and others: a World's walls on a grid, and lines of sight across it."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
import shapely

from foretwin.contracts.arrays import Array, Flags
from foretwin.contracts.world import World
from foretwin.geometry.compiled import IN_ROWS, LINE, given, kernel, types
from foretwin.world_gen.buildings.tags import HEADROOM_M
from foretwin.world_gen.polygon_areas import polygons_from

CELL_M = 0.5
"""A line passes a corner by so much: about as well as footprints in OpenStreetMap are known."""
MOST_CELLS = 2000
"""On a side; the cells of regions that are longer are larger."""
_ENDS_WITHIN_M = 0.2
"""What sticks out from behind a wall by less is not seen."""

Cells = npt.NDArray[np.uint8]
_CELLS = types.Array(types.uint8, 2, "C", readonly=True)


class OpaqueGrid(NamedTuple):
    """Cells (rows, columns) that cannot be seen through, from the corner (west, south) on."""

    cells: Cells
    west_m: float
    south_m: float
    cell_m: float


def opaque_grid(world: World) -> OpaqueGrid | None:
    """Return where a World has walls at the height of eyes; None where it has none.

    What stands on pillars, or has room for a car below it, hides nothing, nor does a fence.
    """
    walls = [(b.outline, b.holes) for b in world.buildings if b.min_height_m < HEADROOM_M]
    thin = [(o.outline, o.holes) for o in world.obstacles if o.opaque]
    if not walls and not thin:
        return None
    # No line may slip between the middles of two cells through a wall that is thinner than one.
    broad = shapely.buffer(polygons_from(thin), CELL_M / 2.0, join_style="mitre") if thin else []
    shapes = np.array([*(polygons_from(walls) if walls else []), *broad], dtype=object)
    west, south, east, north = shapely.total_bounds(shapes).tolist()
    cell_m = max(CELL_M, max(east - west, north - south) / MOST_CELLS)
    shape = math.ceil((north - south) / cell_m) + 1, math.ceil((east - west) / cell_m) + 1
    cells = np.zeros(shape, dtype=np.uint8)
    boxes = (shapely.bounds(shapes) - [west, south, west, south]) / cell_m
    for wall, (left, low, right, high) in zip(shapes, boxes.astype(np.intp).tolist(), strict=True):
        rows, columns = np.mgrid[low : high + 1, left : right + 1]
        shapely.prepare(wall)
        x, y = west + (columns + 0.5) * cell_m, south + (rows + 0.5) * cell_m
        cells[low : high + 1, left : right + 1] |= shapely.contains_xy(wall, x, y)
    return OpaqueGrid(cells, west, south, cell_m)


def hidden(grid: OpaqueGrid, eyes_xy_m: Array, poses: Array, length_m: Array) -> Flags:
    """Return (S, R) who cannot be seen from eyes (S, 2): neither the middle nor an end.

    `poses` (S, R, 3) are box centres, those of who is absent not finite. Walls that the eyes or
    the other stand in hide nothing: there map and position do not go together.
    """
    found = np.zeros(poses.shape[:2])
    half = np.maximum(0.5 * length_m - _ENDS_WITHIN_M, 0.0)
    yaw = poses[..., 2]
    _hidden(
        grid.cells,
        np.array([grid.west_m, grid.south_m, grid.cell_m]),
        eyes_xy_m,
        poses,
        half * np.cos(yaw),
        half * np.sin(yaw),
        found,
    )
    return found > 0.0


@kernel(types.void, _CELLS, LINE, IN_ROWS, given(3), IN_ROWS, IN_ROWS, types.float64[:, :])
def _hidden(
    cells: Cells,
    grid: Array,
    eyes: Array,
    poses: Array,
    along_x: Array,
    along_y: Array,
    found: Array,
) -> None:
    """Fill `found` (S, R) with 1 where all of middle, front and rear lie behind a wall."""
    rows, columns = cells.shape
    west, south, cell = grid[0], grid[1], grid[2]
    for s in range(poses.shape[0]):
        from_x, from_y = (eyes[s, 0] - west) / cell, (eyes[s, 1] - south) / cell
        for r in range(poses.shape[1]):
            x, y = poses[s, r, 0], poses[s, r, 1]
            if not math.isfinite(x + y + from_x + from_y):
                continue
            seen = False
            for end in range(3):
                if end > 0 and along_x[s, r] == 0.0 and along_y[s, r] == 0.0:
                    break
                share = 0.0 if end == 0 else (1.0 if end == 1 else -1.0)
                way_x = (x + share * along_x[s, r] - west) / cell - from_x
                way_y = (y + share * along_y[s, r] - south) / cell - from_y
                steps = int(2.0 * math.sqrt(way_x * way_x + way_y * way_y)) + 1
                outside, in_wall, blocked = False, False, False
                for k in range(steps + 1):
                    column = math.floor(from_x + way_x * k / steps)
                    row = math.floor(from_y + way_y * k / steps)
                    opaque = 0 <= row < rows and 0 <= column < columns and cells[row, column] > 0
                    if opaque:
                        in_wall = outside
                    elif in_wall:
                        blocked = True
                        break
                    else:
                        outside = True
                if not blocked:
                    seen = True
                    break
            if not seen:
                found[s, r] = 1.0
