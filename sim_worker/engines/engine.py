"""What an engine is: the motion of cars in answer to their actuators, and nothing else.

Planners, road users, actuators and verdicts are the same for all; MuJoCo's own stage needs none of
this.
"""

from __future__ import annotations

from typing import NamedTuple, Protocol

from foretwin.contracts.arrays import Array, Flags, Indices


class Seeds(NamedTuple):
    """How K cars begin: base_link `states` (K, 8) in the World's frame, `friction` (K,) under
    their tyres, and `backwards` (K,), whose gear is in reverse."""

    states: Array
    friction: Array
    backwards: Flags


class Demand(NamedTuple):
    """What the actuators of S cars do during one control tick.

    `drive_mps2` (S,) is the drive's force over the mass along the body's x axis, `brake_mps2` (S,)
    that of the brakes, zero or more, against the motion; `climb_mps2` (S,) is what the slope takes.
    `tire_angle_rad` (steps, S) are the tyres' angles at the end of each physics step.
    """

    drive_mps2: Array
    brake_mps2: Array
    climb_mps2: Array
    tire_angle_rad: Array


class PhysicsEngine(Protocol):
    """S cars in motion on open ground; belongs to one thread."""

    def reset(self, rows: Indices, seeds: Seeds) -> None:
        """Let the cars `rows` (K,) begin; row 0 first of all, others go on as they are."""

    def step(self, demand: Demand) -> Array:
        """Advance by one control tick; return (7, S), the first columns of base_link states."""

    def close(self) -> None:
        """End what it has started; nothing is asked of it any more."""
