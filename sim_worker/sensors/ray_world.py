"""A World and its road users as rays meet them."""

from __future__ import annotations

from typing import NamedTuple

import mujoco
import numpy as np
import numpy.typing as npt

from foretwin.contracts.arrays import Array, Indices
from foretwin.contracts.world import World
from foretwin.sim_worker.sensors.materials import OTHER_REFLECTIVITY, REFLECTIVITY
from foretwin.sim_worker.sensors.moving_boxes import NO_BODIES, ModelAmongBoxes, MovingBoxes
from foretwin.world_gen.export.mjcf import UNTOUCHED, world_spec


class RayHits(NamedTuple):
    """What N rays met: distance (N,), infinite where nothing, the cosine between ray and normal
    (N,), the share of light given back (N,), and which body (N,), -1 where none of them."""

    distance_m: Array
    cos_incidence: Array
    reflectivity: Array
    body: Indices


class RayWorld:
    """Static bodies of a World, none without one, and boxes that are placed anew at each look.

    The ground is a plane of the World's size: a World of rays is flat, as that of futures is.
    """

    def __init__(self, world: World | None = None) -> None:
        self._world = world
        self._among = ModelAmongBoxes(self._standing)
        self._reflectivity: npt.NDArray[np.float64] = np.zeros(0)
        self.set_bodies(NO_BODIES)

    @property
    def parts(self) -> int:
        """How many static bodies there are, the ground among them."""
        return self._among.first

    def set_bodies(self, bodies: MovingBoxes) -> None:
        """Put other boxes in place of those that were there; `look` says where they are."""
        geoms = self._among.set(bodies)
        if len(self._reflectivity) != self._among.model.ngeom:
            self._reflectivity = self._of_standing()
        self._reflectivity[geoms] = bodies.reflectivity

    def look(self, origin_m: Array, directions: Array, *, time_s: float, range_m: float) -> RayHits:
        """Return what rays (N, 3) of length 1 from a point (3,) meet within a range.

        `time_s` is since the bodies were where they were said to be: they drive straight on.
        """
        self._among.place(time_s)
        n = len(directions)
        geom, met_m = np.empty(n, dtype=np.int32), np.empty(n)
        normal = np.empty(3 * n)
        mujoco.mj_multiRay(
            self._among.model, self._among.data, np.asarray(origin_m, dtype=np.float64),
            np.ascontiguousarray(directions).ravel(), None, True, -1, geom, met_m, normal, n,
            range_m,
        )  # fmt: skip
        nothing = (geom < 0) | (met_m < 0.0) | (met_m > range_m)
        cos_incidence = np.abs(np.einsum("ij,ij->i", normal.reshape(n, 3), directions))
        cos_incidence[nothing] = 0.0
        return RayHits(
            distance_m=np.where(nothing, np.inf, met_m),
            cos_incidence=np.minimum(cos_incidence, 1.0),
            reflectivity=np.where(nothing, 0.0, self._reflectivity[geom]),
            body=np.where(nothing, -1, np.maximum(geom - self._among.first, -1)),
        )

    def _standing(self) -> mujoco.MjSpec:
        spec = mujoco.MjSpec() if self._world is None else world_spec(self._world)
        for geom in spec.geoms:
            if geom.name in ("road", "ground"):
                spec.delete(geom)  # the road's triangles lie on the ground, which is enough
            else:
                # Rays go down the tree of what can collide, and pass by whatever else is in a body.
                geom.contype, geom.conaffinity = 1, 1
        if self._world is not None:
            size = [self._world.radius_m, self._world.radius_m, 1.0]
            spec.worldbody.add_body().add_geom(
                name="ground", type=mujoco.mjtGeom.mjGEOM_PLANE, size=size, **UNTOUCHED
            )
        return spec

    def _of_standing(self) -> npt.NDArray[np.float64]:
        model, first = self._among.model, self._among.first
        names = (model.geom(k).name for k in range(first))
        found = np.zeros(model.ngeom)
        found[:first] = [REFLECTIVITY.get(one.split(":")[0], OTHER_REFLECTIVITY) for one in names]
        return found
