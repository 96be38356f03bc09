"""What moves virtual road users: the interface of its kinds, in the frame of a World."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple, Protocol

from foretwin.contracts.arrays import Array
from foretwin.contracts.drive import RoadUserKind, SignalColour
from foretwin.contracts.frames import LocalFrame
from foretwin.contracts.world import World

STEP_S = 0.05
"""Of the car's time: 20 Hz, twice as often as detected objects usually come."""
UNSEEN_M = 100.0
"""From the car: nearer than this nobody comes or goes. Chosen: 7 s at 50 km/h."""
FIRST_M = 25.0
"""From the car, those who are there as it begins."""


class VirtualUser(NamedTuple):
    """A road user now: the middle of its box on the ground."""

    user_id: str
    kind: RoadUserKind
    x_m: float
    y_m: float
    yaw_rad: float
    speed_mps: float
    length_m: float
    width_m: float


class TrafficSource(Protocol):
    """A going simulation: a state machine without a clock, the same from the same calls."""

    @property
    def frame(self) -> LocalFrame | None:
        """The plane of all places, None where there is none yet."""

    def use_world(self, world: World) -> None:
        """Go on in another World: nobody jumps."""

    def use_path(self, xy_m: Array) -> None:
        """Take where the car will drive (N, 2)."""

    def step(
        self, car: Array, *, time_s: float, colours: Mapping[str, SignalColour]
    ) -> tuple[VirtualUser, ...]:
        """Move on by `STEP_S` to drive time `time_s` beside a car whose base_link is at `car` (8,),
        as `futures.STATE_COLUMNS`, and return who is there; `colours` are those of lights."""
