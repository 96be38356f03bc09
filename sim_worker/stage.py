"""S vehicles of one kind in one World, stepped together: physics without planners or scenarios."""

from __future__ import annotations

from typing import Any, NamedTuple

import mujoco
import numpy as np
import numpy.typing as npt
from mujoco import batch as mujoco_batch

from contracts.arrays import Array
from contracts.vehicle import VehicleParameters
from contracts.world import World
from sim_worker.vehicle.actuation import Actuation, actuator_ids
from sim_worker.vehicle.clock import silence_step_clock
from sim_worker.vehicle.mujoco_log import log_mujoco_warnings
from sim_worker.vehicle.planar import (
    TIMESTEP_S,
    base_from_cog,
    check_steering_delay,
    cog_from_base,
    set_physics_options,
    vehicle_spec,
)
from world_gen.export.mjcf import ROAD_USER, VEHICLE
from world_gen.export.mjcf import world_spec as spec_of_world

ROAD_USER_LENGTH_M, ROAD_USER_WIDTH_M, ROAD_USER_HEIGHT_M = 4.5, 1.8, 1.5
PREFIX = "ego_"
_ROAD_USER = "road_user"
_STATIC_CONTACT = "static_contact"
_ROAD_USER_CONTACT = "road_user_contact"
_FAR_M = 1.0e4
"""Where the road user of a future without one is kept."""


class Controls(NamedTuple):
    """Commands of one control tick, each (S,): acceleration and angle at the tyres."""

    accel_mps2: Array
    tire_angle_rad: Array


def world_spec(world: World | None) -> mujoco.MjSpec:
    """Return the spec of `world`, or of open ground, with the physics options set."""
    if world is None:
        spec = mujoco.MjSpec()
        spec.modelname = "open ground"
    else:
        spec = spec_of_world(world, visual=False)
    set_physics_options(spec)
    for geom in spec.geoms:
        # The planar vehicle never touches the ground: its plane would be tested in vain.
        if geom.type == mujoco.mjtGeom.mjGEOM_PLANE:
            geom.contype, geom.conaffinity = 0, 0
    return spec


class Stage:
    """A compiled World with one vehicle and one kinematic road user, times `nsim`.

    Belongs to one thread. Seeding with S ≤ nsim states uses the first S simulations. A result
    depends on the seeds and commands alone, not on what the stage did before.
    """

    def __init__(
        self,
        world: World | None,
        vehicle: VehicleParameters,
        *,
        nsim: int,
        control_hz: float = 20.0,
        threads: int = 1,
        spec: mujoco.MjSpec | None = None,
    ) -> None:
        """Compile; `spec` replaces the World's own geometry (for tests).

        Raises ValueError where a control tick is no whole number of physics steps.
        """
        silence_step_clock()
        log_mujoco_warnings()
        steps = 1.0 / (control_hz * TIMESTEP_S)
        if steps < 1.0 or abs(steps - round(steps)) > 1e-6:
            raise ValueError(
                f"control rate {control_hz:g} Hz must divide {1.0 / TIMESTEP_S:g} Hz evenly"
            )
        self.world = world
        self.vehicle = vehicle
        self.nsim = nsim
        self.control_dt_s = 1.0 / control_hz
        self.steps_per_tick = round(steps)
        self.timestep_s = TIMESTEP_S
        rate = vehicle.max_tire_rate_radps.value * TIMESTEP_S
        self._reach = rate * np.arange(1, self.steps_per_tick + 1)
        self.model = _compile(world_spec(world) if spec is None else spec, vehicle)
        self._batch = mujoco_batch.Batch(self.model, nsim, nthread=threads, persistent=True)
        self._bind()
        self._ids: Any = None
        self._count = 0
        self._states = np.zeros((nsim, 8))
        self._record: dict[str | int | mujoco.mjtState, np.ndarray[Any, Any]] = {}

    def _bind(self) -> None:
        batch, model = self._batch, self.model
        self._qpos, self._qvel = batch.bind("qpos"), batch.bind("qvel")
        self._ctrl, self._history = batch.bind("ctrl"), batch.bind("history")
        self._delay = batch.expand("actuator_delay")
        self._biasprm = batch.expand("actuator_biasprm")
        self._forcerange = batch.expand("actuator_forcerange")
        self._actuators = actuator_ids(model, PREFIX)
        names = ("x", "y", "yaw", "steer")
        self._joints = np.array([model.joint(PREFIX + name).qposadr[0] for name in names])
        self._dofs = np.array([model.joint(PREFIX + name).dofadr[0] for name in names])
        steer = self._actuators.steer
        samples = int(model.actuator_history[steer][0])
        first = int(model.actuator_historyadr[steer]) + 2 + samples
        self._steer_history = slice(first, first + samples)
        self._history_samples = samples
        self._static_contact = int(model.sensor(_STATIC_CONTACT).adr[0])
        self._road_user_contact = int(model.sensor(_ROAD_USER_CONTACT).adr[0])
        state = mujoco.mjtState
        # Control, road user position and orientation, in the order of the state's bits.
        self._control_spec = int(
            state.mjSTATE_CTRL | state.mjSTATE_MOCAP_POS | state.mjSTATE_MOCAP_QUAT
        )
        self._control_size = model.nu + 7 * model.nmocap

    def seed(
        self,
        states: Array,
        *,
        steering_delay_s: Array,
        friction_factor: Array,
        steering_history_rad: Array | None = None,
    ) -> None:
        """Start S futures from base_link `states` (S, 8) in the World's frame.

        `steering_delay_s` (S,) whole, `friction_factor` (S,) of the vehicle's friction.
        `steering_history_rad` (S, H) are the tyre angles commanded before, one physics step
        apart, latest last; without it the present angle counts as having been commanded all along.
        Raises ValueError for too many states or a delay beyond the buffer.
        """
        count = len(states)
        if not 1 <= count <= self.nsim:
            raise ValueError(f"{count} states for a stage of {self.nsim} simulations")
        check_steering_delay(steering_delay_s)
        self._count = count
        self._ids = np.arange(count)
        self._batch.reset(ids=self._ids, stage=mujoco.mjtStage.mjSTAGE_NONE)
        rows = slice(0, count)
        limit = self.vehicle.max_tire_angle_rad.value
        start = np.array(states, dtype=np.float64)
        start[:, 6] = np.clip(start[:, 6], -limit, limit)
        self._states[rows] = start
        positions, velocities = cog_from_base(self.vehicle, start)
        self._qpos[rows, self._joints] = positions
        self._qvel[rows, self._dofs] = velocities
        self._tire_command = start[:, 6].copy()
        self._ctrl[rows] = 0.0
        self._ctrl[rows, self._actuators.steer] = self._tire_command
        history = np.repeat(self._tire_command[:, None], self._history_samples, axis=1)
        if steering_history_rad is not None:
            given = np.clip(steering_history_rad, -limit, limit)[:, -self._history_samples :]
            history[:, : -given.shape[1]] = given[:, :1]
            history[:, -given.shape[1] :] = given
            self._tire_command = given[:, -1].copy()
        self._history[rows, self._steer_history] = history
        self._delay[rows, self._actuators.steer] = steering_delay_s
        self._friction = self.vehicle.friction.value * np.asarray(friction_factor, dtype=np.float64)
        self._actuation = Actuation(
            self.vehicle,
            self._actuators,
            ctrl=self._ctrl[rows],
            biasprm=self._biasprm[rows],
            forcerange=self._forcerange[rows],
        )
        steps = self.steps_per_tick
        self._controls = np.zeros((count, steps, self._control_size))
        self._road_users = self._controls[:, :, self.model.nu :]
        self._road_users[:, :, 0:3] = (_FAR_M, _FAR_M, 0.0)
        self._road_users[:, :, 3] = 1.0
        self._record = {
            "sensordata": np.zeros((count, steps, self.model.nsensordata)),
        }

    def step(self, controls: Controls, *, road_users: Array | None = None) -> None:
        """Advance one control tick.

        `road_users` (S, K, 3) gives x, y, yaw of the road user's box centre at the end of each of
        the K physics steps of the tick, NaN where a future has none: a road user that jumped once
        a tick would hit with several times its speed.
        """
        rows = slice(0, self._count)
        self._actuation.apply(
            speed_mps=self._states[rows, 3],
            accel_mps2=controls.accel_mps2,
            friction=self._friction,
        )
        nu, per_step = self.model.nu, self._controls
        per_step[:, :, :nu] = self._ctrl[rows, None, :]
        # The road wheels turn no faster than their rate limit: spread the command over the tick.
        change = (controls.tire_angle_rad - self._tire_command)[:, None]
        per_step[:, :, self._actuators.steer] = self._tire_command[:, None] + np.minimum(
            np.maximum(change, -self._reach), self._reach
        )
        self._tire_command = per_step[:, -1, self._actuators.steer].copy()
        if road_users is not None:
            self._place_road_users(road_users)
        self._batch.rollout(
            self.steps_per_tick,
            control=per_step,
            control_spec=self._control_spec,
            record=("sensordata",),
            ids=self._ids,
            out=self._record,
        )
        states = self._states[rows]
        before = states[:, 3].copy()
        base_from_cog(
            self.vehicle, self._qpos[rows, self._joints], self._qvel[rows, self._dofs], states
        )
        states[:, 7] = (states[:, 3] - before) / self.control_dt_s

    def _place_road_users(self, poses: Array) -> None:
        there = np.isfinite(poses[:, :, :1])
        users = self._road_users
        users[:, :, :2] = np.where(there, poses[:, :, :2], _FAR_M)
        half = np.where(there[:, :, 0], 0.5 * poses[:, :, 2], 0.0)
        users[:, :, 3] = np.cos(half)
        users[:, :, 6] = np.sin(half)

    @property
    def states(self) -> Array:
        """Base_link states (S, 8) now; a live array that the next step overwrites."""
        return self._states[: self._count]

    @property
    def static_contact(self) -> npt.NDArray[np.bool_]:
        """(S,) bool: whether the vehicle touched a building or island during the last tick."""
        return self._touched(self._static_contact)

    @property
    def road_user_contact(self) -> npt.NDArray[np.bool_]:
        """(S,) bool: whether the vehicle touched its road user during the last tick."""
        return self._touched(self._road_user_contact)

    def _touched(self, sensor: int) -> npt.NDArray[np.bool_]:
        found = self._record["sensordata"][:, :, sensor]
        return np.asarray((found > 0.0).any(axis=1))

    def diverged(self) -> npt.NDArray[np.bool_]:
        """(S,) bool: whether a simulation's state is not finite or beyond all bounds."""
        states = self.states
        return np.asarray(
            ~np.isfinite(states).all(axis=1)
            | (np.abs(states[:, 3]) > 200.0)
            | (np.abs(states[:, 5]) > 50.0)
        )


def _compile(spec: mujoco.MjSpec, vehicle: VehicleParameters) -> mujoco.MjModel:
    spec.attach(vehicle_spec(vehicle), prefix=PREFIX, frame=spec.worldbody.add_frame())
    add_road_user(spec, name=_ROAD_USER)
    body = mujoco.mjtObj.mjOBJ_BODY
    for name, other in ((_STATIC_CONTACT, "world"), (_ROAD_USER_CONTACT, _ROAD_USER)):
        sensor = spec.add_sensor(
            name=name,
            type=mujoco.mjtSensor.mjSENS_CONTACT,
            objtype=body,
            objname=PREFIX + "chassis",
            reftype=body,
            refname=other,
        )
        sensor.intprm = [1 << int(mujoco.mjtConDataField.mjCONDATA_FOUND), 0, 1]
    return spec.compile()


def add_road_user(spec: mujoco.MjSpec, *, name: str, collides: bool = True) -> None:
    """Add a kinematic car-sized box whose body origin is its centre on the ground."""
    body = spec.worldbody.add_body(name=name, mocap=True, pos=[_FAR_M, _FAR_M, 0.0])
    body.add_geom(
        name=name,
        type=mujoco.mjtGeom.mjGEOM_BOX,
        size=[ROAD_USER_LENGTH_M / 2, ROAD_USER_WIDTH_M / 2, ROAD_USER_HEIGHT_M / 2],
        pos=[0.0, 0.0, ROAD_USER_HEIGHT_M / 2],
        contype=ROAD_USER if collides else 0,
        conaffinity=VEHICLE if collides else 0,
        rgba=[0.9, 0.4, 0.2, 1.0],
    )
