"""Drives a stage open loop: what the vehicle tests have in common."""

from __future__ import annotations

import msgspec
import numpy as np

from foretwin.contracts.arrays import Array
from foretwin.contracts.vehicle import Parameter, VehicleParameters
from foretwin.sim_worker.batch.batch_simulation import BatchSimulation, Controls


def altered(vehicle: VehicleParameters, **values: float) -> VehicleParameters:
    changes = {name: Parameter(value, None, "test") for name, value in values.items()}
    return msgspec.structs.replace(vehicle, **changes)


def states(count: int, *, speed: Array | float = 0.0, tire: Array | float = 0.0) -> Array:
    rows = np.zeros((count, 8))
    rows[:, 3] = speed
    rows[:, 6] = tire
    return rows


def seed(
    stage: BatchSimulation,
    rows: Array,
    *,
    delay: Array | float = 0.0,
    friction: Array | float = 1.0,
) -> None:
    count = len(rows)
    stage.seed(
        rows,
        steering_delay_s=np.broadcast_to(delay, count),
        friction_factor=np.broadcast_to(friction, count),
    )


def drive(
    stage: BatchSimulation, ticks: int, *, accel: Array | float = 0.0, tire: Array | float = 0.0,
    hold_speed: Array | None = None,
) -> Array:  # fmt: skip
    """Return (S, ticks + 1, 8) states under constant commands, or at a held speed."""
    count = len(stage.states)
    record = [stage.states.copy()]
    angle = np.broadcast_to(tire, count)
    for _ in range(ticks):
        command = np.broadcast_to(accel, count)
        if hold_speed is not None:
            command = 4.0 * (hold_speed - stage.states[:, 3])
        stage.step(Controls(command, angle))
        record.append(stage.states.copy())
    return np.stack(record, axis=1)
