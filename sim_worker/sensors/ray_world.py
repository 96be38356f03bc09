"""A World and its road users as rays meet them: static bodies and moving boxes in one model."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import mujoco
import numpy as np
import numpy.typing as npt

from foretwin.contracts.arrays import Array, Indices
from foretwin.contracts.drive import RoadUser
from foretwin.contracts.frames import LocalFrame, local_from_geo, local_from_geo_yaw
from foretwin.contracts.world import World
from foretwin.sim_worker.sensors.materials import (
    OTHER_REFLECTIVITY,
    REFLECTIVITY,
    rcs_m2_of,
    reflectivity_of,
)
from foretwin.sim_worker.vehicle.road_user_kinds import KINDS
from foretwin.world_gen.export.mjcf import UNTOUCHED, world_spec

_AWAY_M = -1e6
"""Below the ground, where no ray comes: bodies that are not there."""
_FEWEST_BODIES = 32


class MovingBoxes(NamedTuple):
    """Boxes on the ground: middles (B, 2), yaws (B,) in a World's frame, sizes (B, 3), speeds (B,)
    along the yaw, and the share of light that they give back (B,)."""

    xy_m: Array
    yaw_rad: Array
    size_m: Array
    speed_mps: Array
    reflectivity: Array
    rcs_m2: Array
    """Radar cross sections (B,)."""


def boxes_of(frame: LocalFrame, users: Sequence[RoadUser]) -> MovingBoxes:
    """Return road users as boxes in a frame; heights are those of their kinds."""
    lat_deg = np.array([user.position.lat_deg for user in users])
    lon_deg = np.array([user.position.lon_deg for user in users])
    yaw_rad = np.array([user.yaw_rad for user in users])
    sizes = [(user.length_m, user.width_m, KINDS[user.kind].height_m) for user in users]
    return MovingBoxes(
        xy_m=local_from_geo(frame, lat_deg, lon_deg).reshape(-1, 2),
        yaw_rad=local_from_geo_yaw(frame, yaw_rad, lat_deg, lon_deg).reshape(-1),
        size_m=np.array(sizes, dtype=np.float64).reshape(-1, 3),
        speed_mps=np.array([user.speed_mps for user in users]),
        reflectivity=np.array([reflectivity_of(user.kind) for user in users]),
        rcs_m2=np.array([rcs_m2_of(user.kind) for user in users]),
    )


NO_BODIES = MovingBoxes(*(np.zeros(shape) for shape in ((0, 2), 0, (0, 3), 0, 0, 0)))


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
        self._bodies = NO_BODIES
        self._compile(_FEWEST_BODIES)

    @property
    def parts(self) -> int:
        """How many static bodies there are, the ground among them."""
        return self._first

    def set_bodies(self, bodies: MovingBoxes) -> None:
        """Put other boxes in place of those that were there; `look` says where they are."""
        count = len(bodies.yaw_rad)
        if count > self._capacity:
            self._compile(2 ** math.ceil(math.log2(count)))
        model, half = self._model, bodies.size_m / 2.0
        geoms = slice(self._first, self._first + count)
        model.geom_size[geoms] = half
        model.geom_rbound[geoms] = np.linalg.norm(half, axis=1)
        self._reflectivity[geoms] = bodies.reflectivity
        self._data.mocap_pos[:, 2] = _AWAY_M
        self._data.mocap_pos[:count, 2] = half[:, 2]
        self._bodies = bodies

    def look(self, origin_m: Array, directions: Array, *, time_s: float, range_m: float) -> RayHits:
        """Return what rays (N, 3) of length 1 from a point (3,) meet within a range.

        `time_s` is since the bodies were where they were said to be: they drive straight on.
        """
        now, count = self._bodies, len(self._bodies.yaw_rad)
        cos, sin = np.cos(now.yaw_rad), np.sin(now.yaw_rad)
        way_m = (now.speed_mps * time_s)[:, None]
        self._data.mocap_pos[:count, :2] = now.xy_m + way_m * np.stack([cos, sin], axis=1)
        self._data.mocap_quat[:count, 0] = np.cos(now.yaw_rad / 2.0)
        self._data.mocap_quat[:count, 3] = np.sin(now.yaw_rad / 2.0)
        mujoco.mj_kinematics(self._model, self._data)
        n = len(directions)
        geom, met_m = np.empty(n, dtype=np.int32), np.empty(n)
        normal = np.empty(3 * n)
        mujoco.mj_multiRay(
            self._model, self._data, np.asarray(origin_m, dtype=np.float64),
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
            body=np.where(nothing, -1, np.maximum(geom - self._first, -1)),
        )

    def _compile(self, capacity: int) -> None:
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
        for _ in range(capacity):
            body = spec.worldbody.add_body(mocap=True, pos=[0.0, 0.0, _AWAY_M])
            body.add_geom(type=mujoco.mjtGeom.mjGEOM_BOX, size=[1.0, 1.0, 1.0], **UNTOUCHED)
        self._model = spec.compile()
        self._data = mujoco.MjData(self._model)
        self._capacity = capacity
        self._first = int(self._model.ngeom) - capacity
        names = (self._model.geom(k).name for k in range(self._first))
        static = [REFLECTIVITY.get(name.split(":")[0], OTHER_REFLECTIVITY) for name in names]
        self._reflectivity: npt.NDArray[np.float64] = np.array([*static, *[0.0] * capacity])
