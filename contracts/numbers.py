"""The numbers of a future, in one table: what may differ from the nominal one, and where it acts.

A new one that acts on a quantity named here is one more row: scenario files, sweeps, the rows of
results and their documentation follow the table.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from types import MappingProxyType
from typing import Literal, NamedTuple

Quantity = Literal[
    "aim.target_speed_mps", "aim.offset_m",
    "ground.friction_factor",
    "vehicle.steering_delay_s",
    "command.accel_mps2", "command.brake_mps2", "command.tire_angle_rad",
    "perception.delay_s", "perception.lost_from_s", "perception.lost_for_s",
    "belief.offset_m",
]  # fmt: skip
"""What a number acts on.

`aim` is what a future strives for, `command` what the planner asks of the actuators (`brake_mps2`
where it asks to slow down), `perception` how others are seen, `belief` where the planner believes
itself to be.
"""
Operation = Literal["multiply", "add"]


class FutureNumber(NamedTuple):
    """One row: `operation` is how the number acts on `acts_on`, and how a sweep's or a future's
    own value joins that of its scenario."""

    part: Literal["aim", "fault"]
    unit: str
    low: float
    high: float
    operation: Operation
    acts_on: Quantity
    meaning: str
    above_low: bool = False
    """Whether `low` itself is out of range."""

    @property
    def neutral(self) -> float:
        """Return the value that changes nothing."""
        return 1.0 if self.operation == "multiply" else 0.0

    def joined(self, value: float, other: float) -> float:
        """Return two values of this number as one."""
        return value * other if self.operation == "multiply" else value + other


_ANY = math.inf
MAX_EXTRA_DELAY_S = 0.4
"""As long as a stage can hold back a command on top of the vehicle's own delay."""

FUTURE_NUMBERS: Mapping[str, FutureNumber] = MappingProxyType({
    "target_speed_factor": FutureNumber(
        "aim", "1", 0.0, _ANY, "multiply", "aim.target_speed_mps",
        "of the speed that the nominal future aims at",
    ),
    "target_speed_offset_mps": FutureNumber(
        "aim", "m/s", -_ANY, _ANY, "add", "aim.target_speed_mps",
        "on top of the speed aimed at",
    ),
    "lateral_shift_m": FutureNumber(
        "aim", "m", -_ANY, _ANY, "add", "aim.offset_m",
        "how far to the left of its place on the path the ego aims",
    ),
    "friction_factor": FutureNumber(
        "fault", "1", 0.0, _ANY, "multiply", "ground.friction_factor",
        "of the friction between tyres and ground", above_low=True,
    ),
    "extra_steering_delay_s": FutureNumber(
        "fault", "s", 0.0, MAX_EXTRA_DELAY_S, "add", "vehicle.steering_delay_s",
        "between a steering command and the tyres, on top of the vehicle's own",
    ),
    "steering_gain": FutureNumber(
        "fault", "1", -_ANY, _ANY, "multiply", "command.tire_angle_rad",
        "of the tyre angle commanded",
    ),
    "steering_offset_rad": FutureNumber(
        "fault", "rad", -_ANY, _ANY, "add", "command.tire_angle_rad",
        "on top of the tyre angle commanded",
    ),
    "brake_gain": FutureNumber(
        "fault", "1", 0.0, _ANY, "multiply", "command.brake_mps2",
        "of the deceleration commanded",
    ),
    "perception_delay_s": FutureNumber(
        "fault", "s", 0.0, _ANY, "add", "perception.delay_s",
        "how late everybody else is seen",
    ),
    "position_offset_m": FutureNumber(
        "fault", "m", -_ANY, _ANY, "add", "belief.offset_m",
        "how far to the left of the truth the planner believes to be",
    ),
    "lost_from_s": FutureNumber(
        "fault", "s", 0.0, _ANY, "add", "perception.lost_from_s",
        "when the loss of all detections begins",
    ),
    "lost_for_s": FutureNumber(
        "fault", "s", 0.0, _ANY, "add", "perception.lost_for_s",
        "how long all detections are lost",
    ),
})  # fmt: skip
"""All numbers of a future by name; those of one quantity act on it in this order."""


class ScenarioNumber(NamedTuple):
    """A number of a scenario's ego or of one of its road users, by its field."""

    unit: str
    low: float = -_ANY
    high: float = _ANY


SCENARIO_NUMBERS: Mapping[str, ScenarioNumber] = MappingProxyType({
    "speed_mps": ScenarioNumber("m/s", 0.0),
    "lateral_shift_m": ScenarioNumber("m"),
    "impact_share": ScenarioNumber("1", 0.0, 1.0),
    "arrives_after_s": ScenarioNumber("s"),
    "gap_m": ScenarioNumber("m", 0.0),
    "lateral_m": ScenarioNumber("m"),
    "acts_after_s": ScenarioNumber("s", 0.0),
    "decel_mps2": ScenarioNumber("m/s²", 0.0),
})  # fmt: skip
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
