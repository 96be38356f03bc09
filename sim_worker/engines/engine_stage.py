"""A stage whose cars another engine moves; all else is the stage's own.

MuJoCo keeps the World: after each tick its cars are put where the engine's are, so that touches of
buildings and islands are found with the same shapes.
"""

from __future__ import annotations

import numpy as np

from foretwin.contracts.arrays import Array, Flags, Indices
from foretwin.contracts.futures import EngineName
from foretwin.contracts.vehicle import VehicleParameters
from foretwin.contracts.world import World
from foretwin.sim_worker.batch.batch_simulation import BatchSimulation, Controls
from foretwin.sim_worker.engines.actuators import Actuators
from foretwin.sim_worker.engines.engine import Demand, PhysicsEngine, Seeds
from foretwin.sim_worker.engines.registry import begin_engine


class EngineStage(BatchSimulation):
    """A `BatchSimulation` for planners and verdicts, whose motion is an engine's."""

    def __init__(
        self,
        world: World | None,
        vehicle: VehicleParameters,
        *,
        engine: EngineName,
        nsim: int,
        control_hz: float = 20.0,
    ) -> None:
        """Compile the World and begin the engine; raises ValueError as both do."""
        super().__init__(world, vehicle, nsim=nsim, control_hz=control_hz)
        self.engine = engine
        self._moves: PhysicsEngine = begin_engine(engine, vehicle, count=nsim)

    def use_vehicle(self, vehicle: VehicleParameters) -> None:
        """Change the vehicle's parameters; seed anew afterwards."""
        super().use_vehicle(vehicle)
        self.close()
        self._moves = begin_engine(self.engine, vehicle, count=self.nsim)

    def close(self) -> None:
        """End what the engine has started."""
        self._moves.close()

    def seed(
        self,
        states: Array,
        *,
        steering_delay_s: Array,
        friction_factor: Array,
        steering_history_rad: Array | None = None,
        backwards: Flags | None = None,
    ) -> None:
        """Start futures as `BatchSimulation.seed`; tyres keep the angle that they have."""
        super().seed(
            states,
            steering_delay_s=steering_delay_s,
            friction_factor=friction_factor,
            steering_history_rad=steering_history_rad,
            backwards=backwards,
        )
        count = len(states)
        start = np.array(self.states)
        self._backwards = np.zeros(count, dtype=bool) if backwards is None else backwards
        self._actuators_of_engine = Actuators(
            self.vehicle,
            states=start,
            friction=self._friction(friction_factor),
            steering_delay_s=np.broadcast_to(steering_delay_s, count),
            backwards=self._backwards,
            steps=self.steps_per_tick,
        )
        seeds = Seeds(start, self._friction(friction_factor), self._backwards)
        self._moves.reset(np.arange(count), seeds)

    def reseed(
        self,
        rows: Indices,
        states: Array,
        *,
        steering_delay_s: Array,
        friction_factor: Array,
    ) -> None:
        """Start some futures anew, as `BatchSimulation.reseed`."""
        super().reseed(
            rows, states, steering_delay_s=steering_delay_s, friction_factor=friction_factor
        )
        start, friction = np.array(self.states[rows]), self._friction(friction_factor)
        self._actuators_of_engine.restart(
            rows, states=start, friction=friction, steering_delay_s=steering_delay_s
        )
        self._moves.reset(rows, Seeds(start, friction, self._backwards[rows]))

    def step(self, controls: Controls) -> None:
        """Advance one control tick."""
        demand: Demand = self._actuators_of_engine.follow(
            controls.accel_mps2, controls.tire_angle_rad, self.climb_mps2
        )
        near = None if self._near_statics.empty else self._near_statics_of(self._live.T)
        columns = self._live.T
        before = columns[3].copy()
        columns[:7] = self._moves.step(demand)
        columns[7] = (columns[3] - before) / self.control_dt_s
        self._heading[:] = np.cos(columns[2]), np.sin(columns[2])
        self.static_contact[:] = False
        self.looked = near is not None and bool(near.any())
        if near is not None and self.looked:
            close = np.flatnonzero(near)
            self._place(close, np.array(self._live[close]))
            at_rest = self._controls[close, :1]
            self.static_contact[close] = self._physics.advance_among(at_rest, close)
        self._feel_slope()
