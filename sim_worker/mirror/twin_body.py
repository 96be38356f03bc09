"""One vehicle that physics moves, in a model that may hold several."""

from __future__ import annotations

import mujoco
import numpy as np

from foretwin.contracts.arrays import Array
from foretwin.contracts.vehicle import VehicleParameters
from foretwin.geometry.slopes import Slopes
from foretwin.sim_worker.vehicle.actuation import Actuation, actuator_ids
from foretwin.sim_worker.vehicle.gravity import climb_mps2
from foretwin.sim_worker.vehicle.planar import JOINTS
from foretwin.sim_worker.vehicle.reference_points import base_from_cog, cog_from_base
from foretwin.sim_worker.vehicle.timestep import TIMESTEP_S

_REFRESH_STEPS = 2
"""Physics steps between two updates of tyre forces."""


class TwinBody:
    """The vehicle attached under `prefix` to a compiled model; states are those of base_link.

    `command` has to be called before and `read` after each step of the model.
    """

    def __init__(
        self,
        model: mujoco.MjModel,
        data: mujoco.MjData,
        vehicle: VehicleParameters,
        *,
        prefix: str,
        slopes: Slopes | None = None,
    ) -> None:
        """`slopes` are those of the roads, where the World is not flat."""
        self.slopes = slopes
        self._model, self._data, self._vehicle = model, data, vehicle
        self._actuators = actuator_ids(model, prefix)
        self._steer = self._actuators.steer
        self._joints = np.array([model.joint(prefix + name).qposadr[0] for name in JOINTS])
        self._dofs = np.array([model.joint(prefix + name).dofadr[0] for name in JOINTS])
        self._state = np.zeros((1, 8))
        self._tire_command = 0.0
        self._steps = 0
        self._actuation = self._fresh_actuation()

    def use_vehicle(self, vehicle: VehicleParameters) -> None:
        """Go on from here with other parameters, which the model has already."""
        self._vehicle = vehicle
        self._move()
        self._actuation = self._fresh_actuation()

    def _fresh_actuation(self) -> Actuation:
        """Return the actuation of a twin that exerts what its state says, and did before."""
        return Actuation(
            self._vehicle,
            self._actuators,
            friction=np.array([self._vehicle.friction.value]),
            ctrl=self._data.ctrl[None],
            biasprm=self._model.actuator_biasprm[None],
            forcerange=self._model.actuator_forcerange[None],
            tick_s=_REFRESH_STEPS * TIMESTEP_S,
            accel_mps2=self._state[:, 7],
        )

    @property
    def state(self) -> Array:
        """Base_link state (8,)."""
        return np.array(self._state[0])

    @property
    def history_samples(self) -> int:
        """Return how many past steering commands `seed` takes, one physics step apart."""
        return int(self._model.actuator_history[self._steer][0])

    def seed(self, state: Array, *, steering_history_rad: Array | None = None) -> None:
        """Put the vehicle at `state` (8,), as if it had driven there.

        `steering_history_rad` (H,) are the tyre angles commanded before, latest last; without it
        the present angle counts as having been commanded all along.
        """
        limit = self._vehicle.max_tire_angle_rad.value
        self._state[0] = state
        self._state[0, 6] = np.clip(state[6], -limit, limit)
        self._write()
        history = np.full(self.history_samples, self._state[0, 6])
        if steering_history_rad is not None:
            history = np.clip(steering_history_rad, -limit, limit)
        times_s = self._data.time - TIMESTEP_S * np.arange(len(history), 0, -1)
        mujoco.mj_initCtrlHistory(self._model, self._data, self._steer, times_s, history)
        self._tire_command = float(history[-1])
        self._steps = 0
        self._actuation = self._fresh_actuation()

    def command(self, *, accel_mps2: float, tire_angle_rad: float) -> None:
        """Set the vehicle's command for the next step."""
        if self._steps % _REFRESH_STEPS == 0:
            self._actuation.apply(
                speed_mps=self._state[:, 3],
                accel_mps2=np.array([accel_mps2]),
                climb_mps2=climb_mps2(self.slopes, self._state),
            )
        self._steps += 1
        reach = self._vehicle.max_tire_rate_radps.value * TIMESTEP_S
        change = tire_angle_rad - self._tire_command
        self._tire_command += min(max(change, -reach), reach)
        self._data.ctrl[self._steer] = self._tire_command

    def read(self) -> None:
        """Take over where the step has moved the vehicle."""
        before = self._state[0, 3]
        base_from_cog(
            self._vehicle,
            self._data.qpos[None, self._joints],
            self._data.qvel[None, self._dofs],
            self._state,
        )
        self._state[0, 7] = (self._state[0, 3] - before) / TIMESTEP_S

    def nudge(self, moved: Array, *, faster_mps: float = 0.0) -> None:
        """Move the vehicle along, across (m) and in yaw (rad), (3,), its own motion going on.

        `faster_mps` is added to its speed. Tyres notice neither.
        """
        state = self._state[0]
        cos, sin = np.cos(state[2]), np.sin(state[2])
        state[0] += cos * moved[0] - sin * moved[1]
        state[1] += sin * moved[0] + cos * moved[1]
        state[2] += moved[2]
        state[3] += faster_mps
        self._move()

    def _move(self) -> None:
        """Write the state, the steered wheels turning on as they did."""
        wheels = self._data.qvel[self._dofs[3]]
        self._write()
        self._data.qvel[self._dofs[3]] = wheels

    def _write(self) -> None:
        positions, velocities = cog_from_base(self._vehicle, self._state)
        self._data.qpos[self._joints] = positions[0]
        self._data.qvel[self._dofs] = velocities[0]
