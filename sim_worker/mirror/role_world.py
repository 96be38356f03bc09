"""One MuJoCo world of several vehicles: each has a body for physics and a box for measurement.

Which of the two others meet is a matter of roles, and may change between two steps.
"""

from __future__ import annotations

from collections.abc import Mapping

import msgspec
import mujoco
import numpy as np

from foretwin.contracts.arrays import Array
from foretwin.contracts.roles import WHAT_STANDS, Role
from foretwin.contracts.vehicle import Parameter, VehicleParameters
from foretwin.contracts.world import World
from foretwin.geometry.slopes import slopes_of
from foretwin.sim_worker.batch.model import change_vehicle, world_spec
from foretwin.sim_worker.mirror.twin_body import TwinBody
from foretwin.sim_worker.vehicle.clock import silence_step_clock
from foretwin.sim_worker.vehicle.lag import without_lags
from foretwin.sim_worker.vehicle.mujoco_log import log_mujoco_warnings
from foretwin.sim_worker.vehicle.planar import CHASSIS, vehicle_spec
from foretwin.sim_worker.vehicle.reference_points import box_centre_from_base_m
from foretwin.world_gen.export.mjcf import ROAD_USER, STATIC, VEHICLE

_BOX = "box"


class RoleWorld:
    """The bodies of `vehicles` in one World; poses are those of base_link in its frame.

    Twins meet what stands, other vehicles' twins and other vehicles' shadows; a vehicle's own
    shadow it passes through. Boxes of shadows move as they are placed, whatever stands in the way.
    """

    def __init__(
        self,
        world: World | None,
        vehicles: Mapping[str, VehicleParameters],
        *,
        commanded: frozenset[str],
    ) -> None:
        """Compile. A twin not in `commanded` moves without lags: its commands are estimated."""
        silence_step_clock()
        log_mujoco_warnings()
        self._commanded = commanded
        self._prefixes = {name: f"v{number}_" for number, name in enumerate(vehicles)}
        parameters = {name: self._as_driven(name, vehicle) for name, vehicle in vehicles.items()}
        spec, slopes = world_spec(world), slopes_of(world)
        for name, vehicle in parameters.items():
            prefix = self._prefixes[name]
            spec.attach(vehicle_spec(vehicle), prefix=prefix, frame=spec.worldbody.add_frame())
            _add_box(spec, prefix + _BOX, vehicle)
            spec.add_exclude(
                name=prefix + "own_shadow", bodyname1=prefix + CHASSIS, bodyname2=prefix + _BOX
            )
        self._model = model = spec.compile()
        self._data = data = mujoco.MjData(model)
        self.twins: dict[str, TwinBody] = {}
        self._mocap: dict[str, int] = {}
        self._geoms: dict[str, tuple[int, int]] = {}
        self._owner_of_geom: dict[int, str] = {}
        for name, vehicle in parameters.items():
            prefix = self._prefixes[name]
            self.twins[name] = TwinBody(model, data, vehicle, prefix=prefix, slopes=slopes)
            self._mocap[name] = int(model.body(prefix + _BOX).mocapid[0])
            geoms = (model.geom(prefix + "box").id, model.geom(prefix + _BOX + "_measured").id)
            self._geoms[name] = geoms
            self._owner_of_geom |= dict.fromkeys(geoms, name)
            self.set_role(name, "ghost")

    def _as_driven(self, name: str, vehicle: VehicleParameters) -> VehicleParameters:
        if name in self._commanded:
            return vehicle
        return msgspec.structs.replace(without_lags(vehicle), steering_delay_s=Parameter(0.0))

    def use_vehicle(self, name: str, vehicle: VehicleParameters) -> None:
        """Go on from here with a twin of other parameters; nothing is moved."""
        vehicle = self._as_driven(name, vehicle)
        change_vehicle(self._model, vehicle, prefix=self._prefixes[name])
        self.twins[name].use_vehicle(vehicle)

    def reset(self) -> None:
        """Forget all motion, contacts and time; boxes stay where they were placed last."""
        data = self._data
        mocap_pos, mocap_quat = data.mocap_pos.copy(), data.mocap_quat.copy()
        mujoco.mj_resetData(self._model, data)
        data.mocap_pos[:], data.mocap_quat[:] = mocap_pos, mocap_quat

    def set_role(self, name: str, role: Role | None) -> None:
        """Let others meet the vehicle's twin, its shadow, both or (ghost, None) neither."""
        twin, box = self._geoms[name]
        solid = role in ("twin", "all")
        self._set_collisions(twin, VEHICLE, STATIC | ROAD_USER | VEHICLE, solid=solid)
        self._set_collisions(box, ROAD_USER, VEHICLE, solid=role in ("shadow", "all"))

    def _set_collisions(self, geom: int, contype: int, conaffinity: int, *, solid: bool) -> None:
        # The body's own masks let MuJoCo skip it whole: each of these bodies has this geom alone.
        model, body = self._model, self._model.geom_bodyid[geom]
        model.geom_contype[geom] = model.body_contype[body] = contype if solid else 0
        model.geom_conaffinity[geom] = model.body_conaffinity[body] = conaffinity if solid else 0

    def place(self, name: str, pose: Array) -> None:
        """Put a vehicle's box at x, y, yaw (3,)."""
        index = self._mocap[name]
        self._data.mocap_pos[index] = (pose[0], pose[1], 0.0)
        half = 0.5 * pose[2]
        self._data.mocap_quat[index] = (np.cos(half), 0.0, 0.0, np.sin(half))

    def box_pose(self, name: str) -> Array:
        """Return x, y, yaw (3,) of a vehicle's box as MuJoCo has it."""
        mujoco.mj_kinematics(self._model, self._data)
        body = self._data.body(self._prefixes[name] + _BOX)
        w, _, _, z = body.xquat
        return np.array([body.xpos[0], body.xpos[1], 2.0 * np.arctan2(z, w)])

    def step(self) -> None:
        """Advance 10 ms; twins are commanded before it and read after it."""
        mujoco.mj_step(self._model, self._data)

    def contacts(self) -> set[tuple[str, str]]:
        """Return which met in the last step, as sorted pairs of names, `world` among them."""
        pairs = set()
        for index in range(self._data.ncon):
            geoms = self._data.contact[index].geom
            one, other = (self._owner_of_geom.get(int(geom), WHAT_STANDS) for geom in geoms)
            if one != other:
                pairs.add((min(one, other), max(one, other)))
        return pairs


def _add_box(spec: mujoco.MjSpec, name: str, vehicle: VehicleParameters) -> None:
    body = spec.worldbody.add_body(name=name, mocap=True)
    height = vehicle.height_m.value
    body.add_geom(
        name=name + "_measured",
        type=mujoco.mjtGeom.mjGEOM_BOX,
        size=[vehicle.length_m.value / 2, vehicle.width_m.value / 2, height / 2],
        pos=[box_centre_from_base_m(vehicle), 0.0, height / 2],
        contype=ROAD_USER,
        conaffinity=VEHICLE,
    )
