"""S vehicles of one kind in one World, stepped together: physics without planners or scenarios."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from foretwin.contracts.arrays import Array, Flags, Indices
from foretwin.contracts.futures import EngineName
from foretwin.contracts.vehicle import VehicleParameters
from foretwin.contracts.world import World
from foretwin.geometry.slopes import Slopes, slopes_of
from foretwin.sim_worker.batch.model import PREFIX, change_vehicle, compile_stage, world_spec
from foretwin.sim_worker.batch.nearness import CarBox, NearStatics, most_drift_m
from foretwin.sim_worker.batch.physics import Physics
from foretwin.sim_worker.vehicle import compiled
from foretwin.sim_worker.vehicle.actuation import Actuation, actuator_ids
from foretwin.sim_worker.vehicle.clock import silence_step_clock
from foretwin.sim_worker.vehicle.gravity import climb_mps2
from foretwin.sim_worker.vehicle.mujoco_log import log_mujoco_warnings
from foretwin.sim_worker.vehicle.planar import JOINTS, check_steering_delay, read_delay_s
from foretwin.sim_worker.vehicle.reference_points import cog_from_base
from foretwin.sim_worker.vehicle.timestep import TIMESTEP_S

_SANE = np.full((8, 1), np.inf)
_SANE[[3, 5], 0] = 200.0, 50.0
"""Bounds of a state's columns: beyond them, a simulation has diverged."""


class Controls(NamedTuple):
    """Commands of one control tick, each (S,): acceleration and angle at the tyres."""

    accel_mps2: Array
    tire_angle_rad: Array


class BatchSimulation:
    """A compiled World with one vehicle, times `nsim`.

    Other road users are no part of it: kinematic bodies have infinite mass and would throw the
    car. Touches are found from outlines.

    Belongs to one thread. Seeding with S ≤ nsim states uses the first S simulations. A result
    depends on the seeds and commands alone, not on what the stage did before.
    """

    engine: EngineName = "mujoco"
    """Whose physics moves the cars; another's stage is a class of its own."""

    def __init__(
        self,
        world: World | None,
        vehicle: VehicleParameters,
        *,
        nsim: int,
        control_hz: float = 20.0,
        threads: int = 1,
        slopes: Slopes | None = None,
    ) -> None:
        """Compile; raises ValueError where a control tick is no whole number of physics steps.

        `slopes` are of the ground where that is not the World's own.
        """
        silence_step_clock()
        log_mujoco_warnings()
        steps = 1.0 / (control_hz * TIMESTEP_S)
        if steps < 1.0 or abs(steps - round(steps)) > 1e-6:
            raise ValueError(
                f"control rate {control_hz:g} Hz must divide {1.0 / TIMESTEP_S:g} Hz evenly"
            )
        self.world = world
        self.slopes = slopes_of(world) if slopes is None else slopes
        self.climb_mps2: Array | None = None
        """(S,) what the slope under each car takes of its acceleration; None where all is flat."""
        self.vehicle = vehicle
        self.nsim = nsim
        self.control_dt_s = 1.0 / control_hz
        self.steps_per_tick = round(steps)
        self.timestep_s = TIMESTEP_S
        self.model = compile_stage(world_spec(world), vehicle)
        """Of the World, with one vehicle in it."""
        self._threads = threads
        self._physics = Physics(self.model, vehicle, nsim=nsim, threads=threads)
        self._bind()
        self._near_statics = NearStatics(self.model)
        self._box = CarBox.of(vehicle, tick_s=self.control_dt_s)
        self._ids: Any = None
        self._count = 0
        # Columns that lie together in memory: each is read far more often than a row.
        self._states = np.zeros((8, nsim)).T
        self._live = self._states[:0]

    def use_vehicle(self, vehicle: VehicleParameters) -> None:
        """Change the vehicle's parameters; seed anew afterwards. Takes a few milliseconds."""
        self.vehicle = vehicle
        change_vehicle(self.model, vehicle)
        self._physics = Physics(self.model, vehicle, nsim=self.nsim, threads=self._threads)
        self._count = 0
        self._box = CarBox.of(vehicle, tick_s=self.control_dt_s)

    def close(self) -> None:
        """End what the stage has started: nothing here."""

    def _bind(self) -> None:
        model = self.model
        self._actuators = actuator_ids(model, PREFIX)
        first = model.joint(PREFIX + JOINTS[0])
        self._joints = slice(first.qposadr[0], first.qposadr[0] + len(JOINTS))
        self._dofs = slice(first.dofadr[0], first.dofadr[0] + len(JOINTS))
        steer = self._actuators.steer
        samples = int(model.actuator_history[steer][0])
        first = int(model.actuator_historyadr[steer]) + 2 + samples
        self._steer_history = slice(first, first + samples)
        self._history_samples = samples

    def seed(
        self,
        states: Array,
        *,
        steering_delay_s: Array,
        friction_factor: Array,
        steering_history_rad: Array | None = None,
        backwards: Flags | None = None,
    ) -> None:
        """Start S futures from base_link `states` (S, 8) in the World's frame.

        `steering_delay_s` (S,) whole, `friction_factor` (S,) of the vehicle's friction.
        `steering_history_rad` (S, H) are the tyre angles commanded before, one physics step
        apart, latest last; without it the present angle counts as having been commanded all along.
        `backwards` (S,) says whose gear is in reverse, where one's is.
        Raises ValueError for too many states or a delay beyond the buffer.
        """
        count = len(states)
        if not 1 <= count <= self.nsim:
            raise ValueError(f"{count} states for a stage of {self.nsim} simulations")
        check_steering_delay(steering_delay_s)
        self._count = count
        self._ids = np.arange(count)
        self._physics.reset(self._ids)
        rows = slice(0, count)
        limit = self.vehicle.max_tire_angle_rad.value
        start = self._place(rows, states)
        self._tire_command = start[:, 6].copy()
        history = np.repeat(self._tire_command[:, None], self._history_samples, axis=1)
        if steering_history_rad is not None:
            given = np.clip(steering_history_rad, -limit, limit)[:, -self._history_samples :]
            history[:, : -given.shape[1]] = given[:, :1]
            history[:, -given.shape[1] :] = given
            self._tire_command = given[:, -1].copy()
        self._physics.history[rows, self._steer_history] = history
        self._physics.delay[rows, self._actuators.steer] = read_delay_s(steering_delay_s)
        self._controls = np.zeros((count, self.steps_per_tick, self.model.nu))
        self._steer_controls = self._controls[:, :, self._actuators.steer].T
        self._actuation = Actuation(
            self.vehicle,
            self._actuators,
            friction=self._friction(friction_factor),
            ctrl=self._controls,
            biasprm=self._physics.biasprm[rows],
            forcerange=self._physics.forcerange[rows],
            tick_s=self.control_dt_s,
            accel_mps2=start[:, 7],
            backwards=backwards,
        )
        self._drift_m = most_drift_m(self.vehicle, friction_factor, self._box)
        self.static_contact = np.zeros(count, dtype=bool)
        """(S,) bool: whether the vehicle touched a building or island during the last tick."""
        self.looked = False
        """Whether contacts were looked for in any simulation during the last tick."""
        self._live = self._states[rows]
        self._motion_now = self._physics.motion[rows].T
        self._heading = np.array([np.cos(start[:, 2]), np.sin(start[:, 2])])
        self._feel_slope()

    def _friction(self, factor: Array) -> Array:
        return self.vehicle.friction.value * np.asarray(factor, dtype=np.float64)

    def _feel_slope(self) -> None:
        if self.slopes is not None:
            self.climb_mps2 = climb_mps2(self.slopes, self._live, self._heading)

    def reseed(
        self,
        rows: Indices,
        states: Array,
        *,
        steering_delay_s: Array,
        friction_factor: Array,
    ) -> None:
        """Start the futures `rows` (K,) anew from `states` (K, 8); the others go on as they are."""
        check_steering_delay(steering_delay_s)
        self._physics.reset(rows)
        start = self._place(rows, states)
        self._heading[:, rows] = np.cos(start[:, 2]), np.sin(start[:, 2])
        self._tire_command[rows] = start[:, 6]
        self._physics.history[rows, self._steer_history] = start[:, 6:7]
        self._physics.delay[rows, self._actuators.steer] = read_delay_s(steering_delay_s)
        friction = self._friction(friction_factor)
        self._actuation.restart(rows, friction=friction, accel_mps2=start[:, 7])
        self._drift_m[rows] = most_drift_m(self.vehicle, friction_factor, self._box)
        self.static_contact[rows] = False
        self._feel_slope()

    def _place(self, rows: slice | Indices, states: Array) -> Array:
        """Put vehicles where their states are, and return these, within limits."""
        limit = self.vehicle.max_tire_angle_rad.value
        start = np.array(states, dtype=np.float64)
        start[:, 6] = np.clip(start[:, 6], -limit, limit)
        self._states[rows] = start
        positions, velocities = cog_from_base(self.vehicle, start)
        self._physics.qpos[rows, self._joints] = positions
        self._physics.qvel[rows, self._dofs] = velocities
        self._physics.ctrl[rows] = 0.0
        self._physics.ctrl[rows, self._actuators.steer] = start[:, 6]
        return start

    def step(self, controls: Controls) -> None:
        """Advance one control tick."""
        columns = self._live.T
        self._actuation.apply(
            speed_mps=columns[3], accel_mps2=controls.accel_mps2, climb_mps2=self.climb_mps2
        )
        angle = np.asarray(controls.tire_angle_rad, dtype=np.float64)
        # The road wheels turn no faster than their rate limit: spread the command over the tick.
        rate = self.vehicle.max_tire_rate_radps.value * TIMESTEP_S
        compiled.ramp(angle, self._tire_command, rate, self._steer_controls)
        self._advance(self._controls)
        rear = self.vehicle.cog_from_rear_axle_m.value
        compiled.read_base(self._motion_now, rear, self.control_dt_s, columns, self._heading)
        self._feel_slope()

    def _advance(self, per_step: Array) -> None:
        if self.looked:
            self.static_contact[:] = False
        self.looked = False
        if not self._near_statics.empty:
            near = self._near_statics_of(self._live.T)
            self.looked = bool(np.count_nonzero(near))
        if not self.looked:
            self._physics.advance(per_step, None if self._count == self.nsim else self._ids)
            return
        close, far = np.flatnonzero(near), np.flatnonzero(~near)
        self.static_contact[close] = self._physics.advance_among(per_step[close], close)
        if len(far):
            self._physics.advance(per_step[far], far)

    def _near_statics_of(self, columns: Array) -> Flags:
        """(S,) bool: whether a contact during the coming tick cannot be ruled out.

        `columns` (8, S) are those of the states.
        """
        return self._near_statics.may_touch(self._box, columns, self._heading, self._drift_m)

    @property
    def states(self) -> Array:
        """Base_link states (S, 8) now; a live array that the next step overwrites."""
        return self._live

    @property
    def heading(self) -> Array:
        """(2, S) cosine and sine of their yaw; live as well."""
        return self._heading

    def diverged(self) -> Flags:
        """(S,) bool: whether a simulation's state is not finite or beyond all bounds."""
        return np.asarray(~(np.abs(self._live.T) < _SANE).all(axis=0))

    def any_diverged(self) -> bool:
        """Whether there is such a simulation."""
        return not compiled.all_sane(self._live.T, _SANE[:, 0])
