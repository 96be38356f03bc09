"""Faults of S cars as arrays: what they do to commands, and to what a planner believes."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from foretwin.contracts.arrays import Array
from foretwin.contracts.futures import Faults
from foretwin.geometry.frenet_path import FrenetPoint
from foretwin.sim_worker.planner_interface import PlannerOutput
from foretwin.sim_worker.road_users.perception import PerceptionFaults


class Belief(NamedTuple):
    """Where S planners take their cars to be: states (S, 8), offset from the path (S,)."""

    states: Array
    offset_m: Array


class FaultArrays(NamedTuple):
    """The faults of S futures, each (S,)."""

    friction_factor: Array
    steering_delay_s: Array
    steering_gain: Array
    steering_offset_rad: Array
    brake_gain: Array
    position_offset_m: Array
    perception: PerceptionFaults
    spoils_commands: bool
    spoils_belief: bool

    def spoil(self, commands: PlannerOutput) -> tuple[Array, Array]:
        """Return acceleration and tyre angle (S,) as faulty actuators carry them out."""
        accel, angle = commands
        if not self.spoils_commands:
            return accel, angle
        accel = np.where(accel < 0.0, accel * self.brake_gain, accel)
        return accel, angle * self.steering_gain + self.steering_offset_rad

    def believed(self, states: Array, place: FrenetPoint) -> Belief:
        """Return what planners believe of their own place, given the truth."""
        if not self.spoils_belief:
            return Belief(states, place.offset_m)
        aside = self.position_offset_m
        shifted = states.copy()
        shifted[:, 0] -= np.sin(states[:, 2]) * aside
        shifted[:, 1] += np.cos(states[:, 2]) * aside
        return Belief(shifted, place.offset_m + aside)


def fault_arrays(faults: Sequence[Faults]) -> FaultArrays:
    """Lay the faults of S futures out as arrays."""

    def column(name: str) -> Array:
        return np.array([getattr(fault, name) for fault in faults], dtype=np.float64)

    gain, offset, brake = map(column, ("steering_gain", "steering_offset_rad", "brake_gain"))
    position = column("position_offset_m")
    return FaultArrays(
        friction_factor=column("friction_factor"),
        steering_delay_s=column("extra_steering_delay_s"),
        steering_gain=gain,
        steering_offset_rad=offset,
        brake_gain=brake,
        position_offset_m=position,
        perception=PerceptionFaults(
            column("perception_delay_s"), column("lost_from_s"), column("lost_for_s")
        ),
        spoils_commands=bool((gain != 1.0).any() or offset.any() or (brake != 1.0).any()),
        spoils_belief=bool(position.any()),
    )
