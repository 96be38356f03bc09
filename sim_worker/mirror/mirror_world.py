"""One MuJoCo world: the twin, which physics moves; shadow and ghost, which measurement does.

The shadow is a kinematic body that other bodies run into; the ghost is the same without collisions.
"""

from __future__ import annotations

import mujoco
import numpy as np

from foretwin.contracts.arrays import Array
from foretwin.contracts.vehicle import VehicleParameters
from foretwin.contracts.world import World
from foretwin.sim_worker.batch.model import change_vehicle, world_spec
from foretwin.sim_worker.mirror.twin_body import TwinBody
from foretwin.sim_worker.vehicle.clock import silence_step_clock
from foretwin.sim_worker.vehicle.lag import without_lags
from foretwin.sim_worker.vehicle.mujoco_log import log_mujoco_warnings
from foretwin.sim_worker.vehicle.planar import vehicle_spec
from foretwin.sim_worker.vehicle.reference_points import box_centre_from_base_m
from foretwin.world_gen.export.mjcf import ROAD_USER, VEHICLE

TWIN, SHADOW, GHOST = "twin_", "shadow", "ghost"


class MirrorWorld:
    """Twin, shadow and ghost of one car in one World; poses are those of base_link in its frame.

    By default the twin passes through the shadow, since both are the same car in nearly the same
    place; with `twin_meets_shadow` it runs into it as into any other car.
    """

    def __init__(
        self,
        world: World | None,
        vehicle: VehicleParameters,
        *,
        twin_meets_shadow: bool = False,
        steering_delay_s: float | None = None,
    ) -> None:
        """Compile; `steering_delay_s` replaces the vehicle's, whose lags then do not count."""
        silence_step_clock()
        log_mujoco_warnings()
        self._steering_delay_s = steering_delay_s
        if steering_delay_s is not None:
            vehicle = without_lags(vehicle)
        self.vehicle = vehicle
        spec = world_spec(world)
        spec.attach(vehicle_spec(vehicle), prefix=TWIN, frame=spec.worldbody.add_frame())
        _add_measured(spec, SHADOW, vehicle, collides=True)
        _add_measured(spec, GHOST, vehicle, collides=False)
        if not twin_meets_shadow:
            spec.add_exclude(name="own_shadow", bodyname1=TWIN + "chassis", bodyname2=SHADOW)
        self.model = model = spec.compile()
        self.data = mujoco.MjData(model)
        self._twin = TwinBody(
            model, self.data, vehicle, prefix=TWIN, steering_delay_s=steering_delay_s
        )
        self._mocap = {name: int(model.body(name).mocapid[0]) for name in (SHADOW, GHOST)}

    def use_vehicle(self, vehicle: VehicleParameters) -> None:
        """Go on from here with a twin of other parameters; nobody is moved."""
        if self._steering_delay_s is not None:
            vehicle = without_lags(vehicle)
        self.vehicle = vehicle
        change_vehicle(self.model, vehicle, prefix=TWIN)
        self._twin.use_vehicle(vehicle, steering_delay_s=self._steering_delay_s)

    @property
    def history_samples(self) -> int:
        """Return how many past steering commands `seed_twin` takes, one physics step apart."""
        return self._twin.history_samples

    def seed_twin(self, state: Array, *, steering_history_rad: Array | None = None) -> None:
        """Put the twin at base_link `state` (8,), the only way it ever teleports.

        `steering_history_rad` (H,) are the tyre angles commanded before, latest last; without it
        the present angle counts as having been commanded all along.
        """
        data = self.data
        mocap_pos, mocap_quat = data.mocap_pos.copy(), data.mocap_quat.copy()
        mujoco.mj_resetData(self.model, data)
        data.mocap_pos[:], data.mocap_quat[:] = mocap_pos, mocap_quat
        self._twin.seed(state, steering_history_rad=steering_history_rad)

    def place(self, name: str, pose: Array) -> None:
        """Put the shadow or the ghost at x, y, yaw (3,)."""
        index = self._mocap[name]
        self.data.mocap_pos[index] = (pose[0], pose[1], 0.0)
        self.data.mocap_quat[index] = (np.cos(0.5 * pose[2]), 0.0, 0.0, np.sin(0.5 * pose[2]))

    def step(self, *, accel_mps2: float, tire_angle_rad: float) -> None:
        """Advance 10 ms under one command."""
        self._twin.command(accel_mps2=accel_mps2, tire_angle_rad=tire_angle_rad)
        mujoco.mj_step(self.model, self.data)
        self._twin.read()

    @property
    def twin_state(self) -> Array:
        """Base_link state (8,) of the twin."""
        return self._twin.state

    def measured_pose(self, name: str) -> Array:
        """Return x, y, yaw (3,) of the shadow or the ghost as MuJoCo has it."""
        mujoco.mj_kinematics(self.model, self.data)
        body = self.data.body(name)
        w, _, _, z = body.xquat
        return np.array([body.xpos[0], body.xpos[1], 2.0 * np.arctan2(z, w)])

    def contact_force_n(self, name: str) -> float:
        """Return the summed size of the contact forces on the shadow or ghost in the last step."""
        geom = self.model.geom(name).id
        force = np.zeros(6)
        total = 0.0
        for index in range(self.data.ncon):
            contact = self.data.contact[index]
            if geom in (contact.geom[0], contact.geom[1]):
                mujoco.mj_contactForce(self.model, self.data, index, force)
                total += float(np.linalg.norm(force[:3]))
        return total


def _add_measured(
    spec: mujoco.MjSpec, name: str, vehicle: VehicleParameters, *, collides: bool
) -> None:
    body = spec.worldbody.add_body(name=name, mocap=True)
    height = vehicle.height_m.value
    body.add_geom(
        name=name,
        type=mujoco.mjtGeom.mjGEOM_BOX,
        size=[vehicle.length_m.value / 2, vehicle.width_m.value / 2, height / 2],
        pos=[box_centre_from_base_m(vehicle), 0.0, height / 2],
        contype=ROAD_USER if collides else 0,
        conaffinity=VEHICLE if collides else 0,
        rgba=[0.3, 0.3, 0.3, 1.0] if collides else [0.3, 0.3, 0.3, 0.3],
    )
