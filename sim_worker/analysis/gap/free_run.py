"""The planar model left to itself from measured states: many windows in one MuJoCo Batch.

Runs need not be made again: stretches overlap by most of their length.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from foretwin.contracts.arrays import Array, Flags, Indices, Stamps
from foretwin.contracts.vehicle import VehicleParameters
from foretwin.geometry.slopes import Slopes
from foretwin.geometry.steering import column_of
from foretwin.sim_worker.analysis.gap.measured_motion import MeasuredMotion
from foretwin.sim_worker.analysis.motion_record import PERIOD_S, MotionRecord
from foretwin.sim_worker.batch.batch_simulation import BatchSimulation, Controls
from foretwin.sim_worker.vehicle.planar import MAX_STEERING_DELAY_S
from foretwin.sim_worker.vehicle.resistance import resistance_mps2
from foretwin.sim_worker.vehicle.seeding import kinematic_tire_angle, rear_slip_velocity

_TICKS_BACK = round(MAX_STEERING_DELAY_S / PERIOD_S) + 1
_SPEED_GAIN_PS = 4.0
MIN_TURN_RAD = 0.012
"""Of a tyre's angle: the least turn that steering is compared by."""
_AT_MOST = 0.7
"""Of the fastest: tyres that turn by more turn as fast as they can. Chosen."""


class TireAngles(NamedTuple):
    """Tyre angles (N,) as the model reads them: commanded and measured; NaN where unknown."""

    commanded_rad: Array
    measured_rad: Array


def tire_angles(record: MotionRecord, vehicle: VehicleParameters) -> TireAngles:
    """Return the tyre angles that the record's steering means to the model."""
    column = column_of(vehicle)

    def read(tire: Array, wheel: Array) -> Array:
        return np.where(np.isfinite(tire), tire, column.tire_rad(wheel))

    commanded = np.where(
        np.isfinite(record.command_tire_rad),
        record.command_tire_rad + column.offset_rad,
        column.tire_rad(record.command_wheel_rad),
    )
    return TireAngles(commanded, read(record.tire_rad, record.wheel_rad))


def outrun(asked_rad: Array, done_rad: Array, *, fastest_radps: float) -> Flags:
    """Return where (N,) on the grid tyres that turn as fast as they can are behind a command.

    Tyres that turn slower have no such excuse, and of a command that is not known nothing is
    behind.
    """
    step = fastest_radps * PERIOD_S
    behind = np.zeros(len(asked_rad), dtype=np.bool_)
    if not (np.abs(np.diff(asked_rad)) > step).any():
        return behind
    tire = math.nan
    for k, asked in enumerate(asked_rad.tolist()):
        if math.isfinite(tire) and math.isfinite(asked):
            tire = min(max(asked, tire - step), tire + step)
        else:
            tire = asked
        behind[k] = abs(tire - asked) > MIN_TURN_RAD
    turns = np.abs(np.gradient(done_rad)) / PERIOD_S
    return np.asarray(behind & (turns > _AT_MOST * fastest_radps))


class FreeRunner:
    """Runs the model of one vehicle from measured states; keeps its compiled stage.

    Belongs to one thread. The grid is that of a MotionRecord (20 ms).
    """

    def __init__(
        self, vehicle: VehicleParameters, *, batch: int = 32, roads: Slopes | None = None
    ) -> None:
        """`roads` are those under the vehicle, where they are known not to be flat."""
        self.vehicle, self.roads = vehicle, roads
        self._stage = BatchSimulation(None, vehicle, nsim=batch, control_hz=1.0 / PERIOD_S)

    def run(
        self,
        *,
        states: Array,
        starts: Indices,
        steps: int,
        accel_mps2: Array,
        tire_rad: Array,
        hold_speed_mps: Array | None = None,
        delayed: bool | Flags = True,
        climb_mps2: Array | None = None,
    ) -> Array:
        """Return (K, steps + 1, 8) states, K runs from `states` (K, 8) at grid indices `starts`.

        `accel_mps2` and `tire_rad` (N,) are commands on the grid. Where `hold_speed_mps` (N,) is
        known the model follows that speed instead of accelerations; where `delayed`, for all or
        for each run (K,), is false the tyres follow at once, as measured angles must. Gaps in
        commands hold what was before. `climb_mps2` (N,) is what slopes take of the acceleration.
        """
        accel, tire = _filled(accel_mps2), _filled(tire_rad)
        last = len(tire) - 1
        late = np.broadcast_to(np.asarray(delayed), len(starts))
        parts = []
        for first in range(0, len(starts), self._stage.nsim):
            chunk = slice(first, first + self._stage.nsim)
            at, begin = starts[chunk], states[chunk]
            back = np.arange(-2 * _TICKS_BACK + 1, 1) // 2
            history = tire[np.clip(at[:, None] - 1 + back, 0, last)]
            waits = late[chunk]
            self._stage.seed(
                begin,
                steering_delay_s=np.where(waits, self.vehicle.steering_delay_s.value, 0.0),
                friction_factor=np.ones(len(at)),
                steering_history_rad=np.where(waits[:, None], history, begin[:, 6:7]),
            )
            seen = [self._stage.states.copy()]
            for step in range(steps):
                now = np.minimum(at + step, last)
                pushed = accel[now]
                if hold_speed_mps is not None:
                    later = np.minimum(now + 1, last)
                    behind = hold_speed_mps[now] - self._stage.states[:, 3]
                    follows = (hold_speed_mps[later] - hold_speed_mps[now]) / PERIOD_S
                    follows += _SPEED_GAIN_PS * behind
                    pushed = np.where(np.isfinite(follows), follows, pushed)
                self._stage.climb_mps2 = None if climb_mps2 is None else climb_mps2[now]
                self._stage.step(Controls(pushed, tire[now]))
                seen.append(self._stage.states.copy())
            parts.append(np.stack(seen, axis=1))
        return np.concatenate(parts) if parts else np.zeros((0, steps + 1, 8))


def start_states(vehicle: VehicleParameters, motion: MeasuredMotion, *, tire_rad: Array) -> Array:
    """Return (K, 8) states to start from; a tyre angle that is NaN is that of steady cornering."""
    rows = np.zeros((len(tire_rad), 8))
    for row, pose_and_motion, tire in zip(
        rows, np.stack(motion[:6], axis=1), tire_rad, strict=True
    ):
        x, y, yaw, speed, rate, accel = pose_and_motion.tolist()
        slip = rear_slip_velocity(vehicle, speed, rate)
        angle = tire if np.isfinite(tire) else kinematic_tire_angle(vehicle, speed, rate)
        row[:] = x, y, yaw, speed, slip, rate, angle, accel
    return rows


def accel_commands_from_motion(
    vehicle: VehicleParameters,
    *,
    speed_mps: Array,
    accel_mps2: Array,
    climb_mps2: Array | None = None,
) -> Array:
    """Return the accelerations (N,) to command so that the model moves as measured, no lags."""
    force = accel_mps2 * vehicle.wheel_inertia_mass_factor.value
    force = force + resistance_mps2(vehicle, np.nan_to_num(speed_mps), climb_mps2)
    gain = np.where(force > 0.0, vehicle.drive_gain.value, vehicle.brake_gain.value)
    return np.asarray(force / gain)


def _filled(values: Array) -> Array:
    """Hold the last known value through gaps; 0 before the first."""
    known = np.isfinite(values)
    index = np.maximum.accumulate(np.where(known, np.arange(len(values)), -1))
    return np.where(index >= 0, values[np.maximum(index, 0)], 0.0)


class RunMemory:
    """Keeps the runs of one vehicle's model by when and how they began.

    Belongs to one FreeRunner; what is kept is no older than the stretch asked for last.
    """

    def __init__(self) -> None:
        self._known: dict[tuple[int, bool], Array] = {}

    def states(
        self,
        *,
        stamp_ns: Stamps,
        held: Flags,
        settled: Flags,
        from_stamp_ns: int,
        run: Callable[[Indices], Array],
    ) -> Array:
        """Return the states (K, steps + 1, 8) of K runs that began at `stamp_ns`, in both kinds.

        `run` makes those that are not known, by their rows. A run is kept once it is `settled`:
        until then samples may come that belong into it. Older ones than `from_stamp_ns` are
        forgotten.
        """
        keys = list(zip(stamp_ns.tolist(), held.tolist(), strict=True))
        missing = np.array([row for row, key in enumerate(keys) if key not in self._known], np.intp)
        fresh = dict(zip(missing.tolist(), run(missing), strict=True)) if len(missing) else {}
        states = np.stack(
            [fresh[row] if row in fresh else self._known[key] for row, key in enumerate(keys)]
        )
        self._known = {key: kept for key, kept in self._known.items() if key[0] >= from_stamp_ns}
        self._known |= {keys[row]: made for row, made in fresh.items() if settled[row]}
        return states
