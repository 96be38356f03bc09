"""The numbers of a future, in one table: what may differ from the nominal one, and where it acts.

A new one that acts on a quantity named here is one more row: scenario files, sweeps, the rows of
results and their documentation follow the table.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from types import MappingProxyType
from typing import Literal, NamedTuple

_Aim = Literal["aim.target_speed_mps", "aim.offset_m"]
_Command = Literal["command.accel_mps2", "command.brake_mps2", "command.tire_angle_rad"]
_Perception = Literal["perception.delay_s", "perception.lost_from_s", "perception.lost_for_s"]
_Other = Literal["ground.friction_factor", "vehicle.steering_delay_s", "belief.offset_m"]
Quantity = Literal[_Aim, _Command, _Perception, _Other]
"""What a number acts on.

`aim` is what a future strives for, `command` what the planner asks of the actuators (`brake_mps2`
where it asks to slow down), `perception` how others are seen, `belief` where the planner believes
itself to be.
"""
Operation = Literal["multiply", "add"]


class FutureNumber(NamedTuple):
    """One row: `operation` is how the number acts on `acts_on`, and how a sweep's or a future's
    own value joins that of its scenario."""

    unit: str
    operation: Operation
    acts_on: Quantity
    meaning: str
    low: float = -math.inf
    high: float = math.inf
    above_low: bool = False
    """Whether `low` itself is out of range."""

    @property
    def part(self) -> Literal["aim", "fault"]:
        """Whether the future strives for it, or it is a fault of the car or the ground."""
        return "aim" if self.acts_on.startswith("aim.") else "fault"

    @property
    def neutral(self) -> float:
        """Return the value that changes nothing."""
        return 1.0 if self.operation == "multiply" else 0.0

    def joined(self, value: float, other: float) -> float:
        """Return two values of this number as one."""
        return value * other if self.operation == "multiply" else value + other


MAX_EXTRA_DELAY_S = 0.4
"""As long as a stage can hold back a command on top of the vehicle's own delay."""

_FUTURE_NUMBERS = {
    "target_speed_factor": FutureNumber(
        "1",
        "multiply",
        "aim.target_speed_mps",
        "of the speed that the nominal future aims at",
        low=0.0,
    ),
    "target_speed_offset_mps": FutureNumber(
        "m/s", "add", "aim.target_speed_mps", "on top of the speed aimed at"
    ),
    "lateral_shift_m": FutureNumber(
        "m", "add", "aim.offset_m", "how far to the left of its place on the path the ego aims"
    ),
    "friction_factor": FutureNumber(
        "1",
        "multiply",
        "ground.friction_factor",
        "of the ground's friction",
        low=0.0,
        above_low=True,
    ),
    "extra_steering_delay_s": FutureNumber(
        "s",
        "add",
        "vehicle.steering_delay_s",
        "between a steering command and the tyres, on top of the vehicle's own",
        low=0.0,
        high=MAX_EXTRA_DELAY_S,
    ),
    "steering_gain": FutureNumber(
        "1", "multiply", "command.tire_angle_rad", "of the tyre angle commanded"
    ),
    "steering_offset_rad": FutureNumber(
        "rad", "add", "command.tire_angle_rad", "on top of the tyre angle commanded"
    ),
    "brake_gain": FutureNumber(
        "1", "multiply", "command.brake_mps2", "of the deceleration commanded", low=0.0
    ),
    "perception_delay_s": FutureNumber(
        "s", "add", "perception.delay_s", "how late everybody else is seen", low=0.0
    ),
    "position_offset_m": FutureNumber(
        "m", "add", "belief.offset_m", "how far to the left of the truth the planner believes to be"
    ),
    "lost_from_s": FutureNumber(
        "s", "add", "perception.lost_from_s", "when the loss of all detections begins", low=0.0
    ),
    "lost_for_s": FutureNumber(
        "s", "add", "perception.lost_for_s", "how long all detections are lost", low=0.0
    ),
}
FUTURE_NUMBERS: Mapping[str, FutureNumber] = MappingProxyType(_FUTURE_NUMBERS)
"""All numbers of a future by name; those of one quantity act on it in this order."""


class ScenarioNumber(NamedTuple):
    """A number of a scenario's ego or of one of its road users, by its field."""

    unit: str
    low: float = -math.inf
    high: float = math.inf


_SCENARIO_NUMBERS = {
    "speed_mps": ScenarioNumber("m/s", 0.0),
    "lateral_shift_m": ScenarioNumber("m"),
    "impact_share": ScenarioNumber("1", 0.0, 1.0),
    "arrives_after_s": ScenarioNumber("s"),
    "gap_m": ScenarioNumber("m", 0.0),
    "lateral_m": ScenarioNumber("m"),
    "acts_after_s": ScenarioNumber("s", 0.0),
    "decel_mps2": ScenarioNumber("m/s²", 0.0),
}
SCENARIO_NUMBERS: Mapping[str, ScenarioNumber] = MappingProxyType(_SCENARIO_NUMBERS)
"""Numbers of a case by their fields: `ego.speed_mps`, `<actor>.gap_m` and so on."""


def out_of_range(name: str, least: float, most: float) -> str:
    """Return why a number of that name, or field, may not be from `least` to `most`; else nothing.

    Raises KeyError for an unknown name.
    """
    row = FUTURE_NUMBERS.get(name) or SCENARIO_NUMBERS[name]
    if not (math.isfinite(least) and math.isfinite(most)):
        return "must be finite"
    if math.isfinite(row.high) and not row.low <= least <= most <= row.high:
        wrong = least if least < row.low else most
        return f"reaches {wrong:g}; it must be from {row.low:g} to {row.high:g}"
    if least == row.low and isinstance(row, FutureNumber) and row.above_low:
        return f"reaches {least:g}; it must be above {row.low:g}"
    if least < row.low:
        return f"reaches {least:g}; it must be {row.low:g} or more"
    return ""
