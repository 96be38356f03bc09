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


class Range(NamedTuple):
    """What a number may be, both ends included but where it is to be above `low`."""

    low: float
    high: float
    above_low: bool = False

    def __str__(self) -> str:
        low, high = (f"{end}" if isinstance(end, int) else f"{end:g}" for end in self[:2])
        if self.above_low:
            return f"above {low}, at most {high}"
        return f"at least {low}" if self.high == math.inf else f"{low} to {high}"

    def admits(self, value: float) -> bool:
        """Whether a number may be this; no number that is none is admitted."""
        above = self.low < value if self.above_low else self.low <= value
        return above and value <= self.high


MAX_SPEED_MPS = 100.0
"""No car on a road, and no limit, is faster than 360 km/h."""
MAX_ASIDE_M = 50.0
"""Half of the widest road there is, of 26 lanes."""
MAX_BELIEF_OFFSET_M = 100.0
"""As far as satellite positions are off between high buildings, rarely."""
MAX_GAP_M = 2000.0
"""As far as the largest World reaches."""
MAX_HORIZON_S = 60.0
"""What begins after the longest future is over does not happen in it."""
MAX_DECEL_MPS2 = 60.0
"""Six times gravity, as racing cars brake."""
MAX_EXTRA_DELAY_S = 0.4
"""As long as a stage can hold back a command on top of the vehicle's own delay."""
MAX_PERCEPTION_DELAY_S = 10.0
"""What was seen is remembered for each control tick of the delay."""
MAX_SEED = 2**63 - 1
"""As messages and tables hold it."""

_SIDE = Range(-MAX_ASIDE_M, MAX_ASIDE_M)
_WHILE = Range(0.0, MAX_HORIZON_S)
_FACTOR = Range(0.0, 10.0)
"""Ten times what cars do, or ask for, is beyond what any of them can."""


class FutureNumber(NamedTuple):
    """One row: `operation` is how the number acts on `acts_on`, and how a sweep's or a future's
    own value joins that of its scenario."""

    unit: str
    operation: Operation
    acts_on: Quantity
    meaning: str
    range: Range

    @property
    def part(self) -> Literal["aim", "fault"]:
        """Whether the future strives for it, or it is a fault of the car or the ground."""
        return "aim" if self.acts_on.startswith("aim.") else "fault"

    @property
    def neutral(self) -> float:
        """Return the value that changes nothing."""
        return 1.0 if self.operation == "multiply" else 0.0

    def joined(self, value: float, other: float) -> float:
        """Return two values of this number as one, held within its range."""
        both = value * other if self.operation == "multiply" else value + other
        return min(max(both, self.range.low), self.range.high)


_FUTURE_NUMBERS = {
    "target_speed_factor": FutureNumber(
        "1",
        "multiply",
        "aim.target_speed_mps",
        "of the speed that the nominal future aims at",
        _FACTOR,
    ),
    "target_speed_offset_mps": FutureNumber(
        "m/s",
        "add",
        "aim.target_speed_mps",
        "on top of the speed aimed at",
        Range(-MAX_SPEED_MPS, MAX_SPEED_MPS),
    ),
    "lateral_shift_m": FutureNumber(
        "m",
        "add",
        "aim.offset_m",
        "how far to the left of its place on the path the ego aims",
        _SIDE,
    ),
    "friction_factor": FutureNumber(
        "1",
        "multiply",
        "ground.friction_factor",
        "of the ground's friction",
        Range(0.0, 4.0, above_low=True),  # Drag racers on a prepared strip.
    ),
    "extra_steering_delay_s": FutureNumber(
        "s",
        "add",
        "vehicle.steering_delay_s",
        "between a steering command and the tyres, on top of the vehicle's own",
        Range(0.0, MAX_EXTRA_DELAY_S),
    ),
    "steering_gain": FutureNumber(
        "1",
        "multiply",
        "command.tire_angle_rad",
        "of the tyre angle commanded",
        Range(-10.0, 10.0),  # From little to the tyres' limit, to either side.
    ),
    "steering_offset_rad": FutureNumber(
        "rad",
        "add",
        "command.tire_angle_rad",
        "on top of the tyre angle commanded",
        Range(-1.5, 1.5),  # Tyres turn by less than a right angle.
    ),
    "brake_gain": FutureNumber(
        "1", "multiply", "command.brake_mps2", "of the deceleration commanded", _FACTOR
    ),
    "perception_delay_s": FutureNumber(
        "s",
        "add",
        "perception.delay_s",
        "how late everybody else is seen",
        Range(0.0, MAX_PERCEPTION_DELAY_S),
    ),
    "position_offset_m": FutureNumber(
        "m",
        "add",
        "belief.offset_m",
        "how far to the left of the truth the planner believes to be",
        Range(-MAX_BELIEF_OFFSET_M, MAX_BELIEF_OFFSET_M),
    ),
    "lost_from_s": FutureNumber(
        "s", "add", "perception.lost_from_s", "when the loss of all detections begins", _WHILE
    ),
    "lost_for_s": FutureNumber(
        "s", "add", "perception.lost_for_s", "how long all detections are lost", _WHILE
    ),
}
FUTURE_NUMBERS: Mapping[str, FutureNumber] = MappingProxyType(_FUTURE_NUMBERS)
"""All numbers of a future by name; those of one quantity act on it in this order."""
NEUTRAL: Mapping[str, float] = {name: row.neutral for name, row in FUTURE_NUMBERS.items()}


class ScenarioNumber(NamedTuple):
    """A number of a scenario's ego or of one of its road users, by its field."""

    unit: str
    range: Range


_SCENARIO_NUMBERS = {
    "speed_mps": ScenarioNumber("m/s", Range(0.0, MAX_SPEED_MPS)),
    "lateral_shift_m": ScenarioNumber("m", _SIDE),
    "impact_share": ScenarioNumber("1", Range(0.0, 1.0)),
    "arrives_after_s": ScenarioNumber("s", Range(-MAX_HORIZON_S, MAX_HORIZON_S)),
    "gap_m": ScenarioNumber("m", Range(0.0, MAX_GAP_M)),
    "lateral_m": ScenarioNumber("m", _SIDE),
    "acts_after_s": ScenarioNumber("s", _WHILE),
    "decel_mps2": ScenarioNumber("m/s²", Range(0.0, MAX_DECEL_MPS2)),
}
SCENARIO_NUMBERS: Mapping[str, ScenarioNumber] = MappingProxyType(_SCENARIO_NUMBERS)
"""Numbers of a case by their fields: `ego.speed_mps`, `<actor>.gap_m` and so on."""


def out_of_range(name: str, least: float, most: float) -> str:
    """Return why a number of that name, or field, may not be from `least` to `most`; else nothing.

    Raises KeyError for an unknown name.
    """
    allowed = (FUTURE_NUMBERS.get(name) or SCENARIO_NUMBERS[name]).range
    if not (math.isfinite(least) and math.isfinite(most)):
        return "must be finite"
    below = least < allowed.low or (allowed.above_low and least == allowed.low)
    if below or most > allowed.high:
        ends = str(allowed) if allowed.above_low else f"from {allowed}"
        return f"reaches {least if below else most:g}; it must be {ends}"
    return ""
