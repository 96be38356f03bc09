"""Road users as boxes in a MuJoCo model of what stands: for rays and for pictures alike."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import NamedTuple

import mujoco
import numpy as np

from foretwin.contracts.arrays import Array
from foretwin.contracts.drive import RoadUser
from foretwin.contracts.frames import LocalFrame, local_from_geo, local_from_geo_yaw
from foretwin.sim_worker.sensors.materials import COLOURS, rcs_m2_of, reflectivity_of
from foretwin.sim_worker.vehicle.road_user_kinds import KINDS
from foretwin.world_gen.export.mjcf import UNTOUCHED

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
    rgb: Array
    """Colours (B, 3), 0 to 1."""


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
        rgb=np.array([COLOURS[user.kind] for user in users]).reshape(-1, 3),
    )


NO_BODIES = MovingBoxes(*(np.zeros(shape) for shape in ((0, 2), 0, (0, 3), 0, 0, 0, (0, 3))))


class ModelAmongBoxes:
    """What stands, from `standing`, and boxes that are placed anew as often as one likes.

    `model` and `data` are others once there are more boxes than there was room for; `first` is the
    number of the first box's geom: all before it stand.
    """

    model: mujoco.MjModel
    data: mujoco.MjData
    first: int

    def __init__(self, standing: Callable[[], mujoco.MjSpec]) -> None:
        self._standing = standing
        self._boxes = NO_BODIES
        self._compile(_FEWEST_BODIES)

    def set(self, boxes: MovingBoxes) -> slice:
        """Put other boxes in place of those that were there; `place` says where they are. Return
        which geoms they are."""
        count = len(boxes.yaw_rad)
        if count > self._capacity:
            self._compile(2 ** math.ceil(math.log2(count)))
        half = boxes.size_m / 2.0
        geoms = slice(self.first, self.first + count)
        self.model.geom_size[geoms] = half
        self.model.geom_rbound[geoms] = np.linalg.norm(half, axis=1)
        self.model.geom_rgba[geoms, :3] = boxes.rgb
        self.data.mocap_pos[:, 2] = _AWAY_M
        self.data.mocap_pos[:count, 2] = half[:, 2]
        self._boxes = boxes
        return geoms

    def place(self, time_s: float) -> None:
        """Put the boxes where they are so long after they were where they were said to be."""
        now, count = self._boxes, len(self._boxes.yaw_rad)
        cos, sin = np.cos(now.yaw_rad), np.sin(now.yaw_rad)
        way_m = (now.speed_mps * time_s)[:, None]
        self.data.mocap_pos[:count, :2] = now.xy_m + way_m * np.stack([cos, sin], axis=1)
        self.data.mocap_quat[:count, 0] = np.cos(now.yaw_rad / 2.0)
        self.data.mocap_quat[:count, 3] = np.sin(now.yaw_rad / 2.0)
        mujoco.mj_kinematics(self.model, self.data)

    def _compile(self, capacity: int) -> None:
        spec = self._standing()
        for _ in range(capacity):
            body = spec.worldbody.add_body(mocap=True, pos=[0.0, 0.0, _AWAY_M])
            body.add_geom(type=mujoco.mjtGeom.mjGEOM_BOX, size=[1.0, 1.0, 1.0], **UNTOUCHED)
        self.model = spec.compile()
        self.data = mujoco.MjData(self.model)
        self._capacity = capacity
        self.first = int(self.model.ngeom) - capacity
