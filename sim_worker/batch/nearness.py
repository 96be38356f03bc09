"""Where a car could touch anything static: elsewhere, contacts need not be looked for.

Looking for contacts costs up to half of a physics step. Leaving it out where there can be none
changes no bit of a result, so every bound here errs towards looking.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import mujoco
import numpy as np
import shapely

from foretwin.contracts.arrays import Array, Flags
from foretwin.contracts.vehicle import VehicleParameters
from foretwin.sim_worker.batch import compiled
from foretwin.sim_worker.vehicle.parameters import GRAVITY_MPS2
from foretwin.sim_worker.vehicle.reference_points import box_centre_from_base_m
from foretwin.sim_worker.vehicle.timestep import TIMESTEP_S
from foretwin.world_gen.export.mjcf import VEHICLE

_BORDER_M = compiled.FAR * compiled.STEP_M + 2.0 * compiled.CELL_M
_CORNERS = np.stack(np.meshgrid(*[[-1.0, 1.0]] * 3, indexing="ij"), axis=-1).reshape(8, 3)


class NearStatics:
    """A grid of how far it is at least, from anywhere in a cell, to anything static."""

    def __init__(self, model: mujoco.MjModel) -> None:
        """Take what stands still and a vehicle collides with, as outlines from above; no ground."""
        outlines = _outlines(model)
        self.empty = not outlines
        points = np.concatenate(outlines) if outlines else np.zeros((1, 2))
        low = points.min(axis=0) - _BORDER_M
        size = np.ceil((points.max(axis=0) + _BORDER_M - low) / compiled.CELL_M).astype(int)
        self._corner = float(low[0]), float(low[1])
        self._steps = np.full(size, compiled.FAR, dtype=np.uint8)
        for outline in outlines:
            compiled.come_near(np.ascontiguousarray(outline), self._corner, self._steps)

    def least_m(self, x_m: float, y_m: float) -> float:
        """Return how far it is at least from a point to anything static."""
        return compiled.least_m(self._steps, self._corner, x_m, y_m)

    def may_touch(self, box: CarBox, states: Array, heading: Array, drift_m: Array) -> Flags:
        """Return (S,) bool: whether a contact during the coming tick cannot be ruled out.

        `states` (8, S) and `heading` (2, S), cosine and sine, are those at its begin; `drift_m`
        (S,) is what `most_drift_m` returns.
        """
        found = np.empty(states.shape[1], dtype=bool)
        box_numbers = tuple(box)  # the kernel knows no names
        compiled.may_touch(self._steps, self._corner, states, heading, drift_m, box_numbers, found)
        return found


class CarBox(NamedTuple):
    """A car's box, whose centre lies ahead of base_link, as does the centre of gravity."""

    half_length_m: float
    half_width_m: float
    ahead_m: float
    cog_ahead_m: float
    corner_m: float
    """How far its farthest corner lies from the centre of gravity."""
    tick_s: float
    """How long it moves for."""

    @classmethod
    def of(cls, vehicle: VehicleParameters, *, tick_s: float) -> CarBox:
        """Return that of a vehicle."""
        half_m, aside_m = vehicle.length_m.value / 2.0, vehicle.width_m.value / 2.0
        ahead_m, cog_m = box_centre_from_base_m(vehicle), vehicle.cog_from_rear_axle_m.value
        corner_m = math.hypot(half_m + abs(ahead_m - cog_m), aside_m)
        return cls(half_m, aside_m, ahead_m, cog_m, corner_m, tick_s)


def most_drift_m(vehicle: VehicleParameters, friction_factor: Array, box: CarBox) -> Array:
    """Return (S,) how far at most a corner is, after a tick, from where no force would take it.

    Braking shifts up to h μ / l of the weight to an axle. What axles bear, times their grip, pushes
    the car aside and turns it; along the road it is the grip once more, and at most gravity where
    that is steep. MuJoCo's steps let the same force act a step longer than a tick.
    """
    friction = vehicle.friction.value * np.asarray(friction_factor, dtype=np.float64)
    grip_mps2, wheelbase_m = friction * GRAVITY_MPS2, vehicle.wheelbase_m.value
    shift = vehicle.cog_height_m.value / wheelbase_m * friction
    behind_m, mass_kg = box.cog_ahead_m, vehicle.mass_kg.value
    arm_m = 2.0 * behind_m * (wheelbase_m - behind_m) / wheelbase_m + shift * wheelbase_m
    turn_radps2 = mass_kg * grip_mps2 * arm_m / vehicle.yaw_inertia_kgm2.value
    accel_mps2 = grip_mps2 * (2.0 + shift) + GRAVITY_MPS2 + turn_radps2 * box.corner_m
    return np.asarray(accel_mps2 * box.tick_s * (box.tick_s + TIMESTEP_S) / 2.0)


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
