"""Where a car could touch anything static: elsewhere, contacts need not be looked for.

Looking for contacts costs up to half of a physics step. Leaving it out where there can be none
changes no bit of a result, so every bound here errs towards looking.
"""

from __future__ import annotations

import math

import mujoco
import numpy as np
import shapely

from foretwin.contracts.arrays import Array, Flags
from foretwin.world_gen.export.mjcf import VEHICLE

_CELL_M = 1.0
_CORNERS = np.stack(np.meshgrid(*[[-1.0, 1.0]] * 3, indexing="ij"), axis=-1).reshape(8, 3)


class NearStatics:
    """A grid of cells from whose points something static is at most `reach_m` away."""

    def __init__(self, model: mujoco.MjModel, *, reach_m: float) -> None:
        """Take what stands still and a vehicle collides with, as outlines from above; no ground.

        The distance to an outline is taken as that to the farthest line through its sides, which
        is never more than the true one; half a cell's diagonal is added.
        """
        reach = reach_m + _CELL_M * math.sqrt(0.5)
        outlines = _outlines(model)
        self.empty = not outlines
        points = np.concatenate(outlines) if outlines else np.zeros((1, 2))
        # A border of cells out of reach catches whatever lies outside.
        self._low = np.floor(points.min(axis=0) - reach) - 2.0 * _CELL_M
        size = np.ceil((points.max(axis=0) + reach - self._low) / _CELL_M).astype(int) + 3
        cells = np.zeros(size, dtype=bool)
        for outline in outlines:
            self._mark(cells, outline, reach)
        self._last = size - 1.0
        self._stride = int(size[1])
        self._cells: Flags = cells.ravel()

    def _mark(self, cells: Flags, outline: Array, reach_m: float) -> None:
        first = ((outline.min(axis=0) - reach_m - self._low) / _CELL_M).astype(int)
        end = ((outline.max(axis=0) + reach_m - self._low) / _CELL_M).astype(int) + 1
        x, y = (self._low[k] + (np.arange(first[k], end[k]) + 0.5) * _CELL_M for k in (0, 1))
        side = np.diff(outline, axis=0)
        side = side / np.maximum(np.hypot(side[:, 0], side[:, 1]), 1e-9)[:, None]
        across = outline[:-1, 0] * side[:, 1] - outline[:-1, 1] * side[:, 0]
        distance = np.full((len(x), len(y)), -np.inf)
        for (along_x, along_y), offset in zip(side, across, strict=True):
            out = x[:, None] * along_y - y * along_x - offset
            np.maximum(distance, out, out=distance)
        cells[first[0] : end[0], first[1] : end[1]] |= distance <= reach_m

    def at(self, xy_m: Array) -> Flags:
        """Return (S,) bool: whether something static may be in reach of points (2, S), x and y."""
        place = xy_m - self._low[:, None]
        place /= _CELL_M
        # fmax and fmin turn what is not a number into a place on the border.
        np.fmax(place, 0.0, out=place)
        np.fmin(place, self._last[:, None], out=place)
        column, row = place.astype(np.intp)
        column *= self._stride
        column += row
        return np.asarray(self._cells[column])


def _outlines(model: mujoco.MjModel) -> list[Array]:
    """Return closed convex rings (N + 1, 2), counter-clockwise from above, of what can be hit."""
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    body = model.geom_bodyid
    static = (model.body_weldid[body] == 0) & (model.body_mocapid[body] < 0)
    static &= model.geom_type != mujoco.mjtGeom.mjGEOM_PLANE
    clouds = []
    for geom in np.flatnonzero(static & (model.geom_conaffinity & VEHICLE > 0)):
        if model.geom_type[geom] == mujoco.mjtGeom.mjGEOM_MESH:
            mesh = model.geom_dataid[geom]
            first = model.mesh_vertadr[mesh]
            points = model.mesh_vert[first : first + model.mesh_vertnum[mesh]].astype(np.float64)
        else:
            points = model.geom_aabb[geom, :3] + _CORNERS * model.geom_aabb[geom, 3:]
        world = points @ data.geom_xmat[geom].reshape(3, 3).T + data.geom_xpos[geom]
        clouds.append(world[:, :2])
    hulls = [shapely.convex_hull(shapely.MultiPoint(cloud)) for cloud in clouds]
    return [shapely.get_coordinates(shapely.orient_polygons(hull)) for hull in hulls]
