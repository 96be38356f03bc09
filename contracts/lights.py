"""What the lights of the World in force show, as the orchestrator tells all who drive by them."""

from __future__ import annotations

from typing import Literal

import msgspec

from foretwin.contracts.drive import SignalColour
from foretwin.contracts.frames import GeoPoint

WhyShown = Literal["plan", "learnt", "heard", "set"]
"""By the World's plan, by a cycle learnt, as the car hears it now, or by somebody's word."""
GOES_ON: frozenset[SignalColour] = frozenset({"green", "dark", "unknown"})
"""At these colours the light itself stops nobody: one that is out leaves the signs in force."""


class StopPlace(msgspec.Struct, frozen=True, kw_only=True):
    """Where vehicles wait for a light: the middle of a stop line, and which way they come there."""

    position: GeoPoint
    yaw_rad: float
    """Of those who drive up to it, counter-clockwise from true east."""


class ShownLight(msgspec.Struct, frozen=True, kw_only=True):
    """What one group of lights shows; `group_id` as in the World."""

    group_id: str
    colour: SignalColour
    why: WhyShown
    next_colour: SignalColour | None = None
    """What it changes to, where that is known."""
    changes_in_s: float | None = None
    """From the stamp on."""
    on_foot: bool = False
    """Whether it is for those on foot alone."""
    stops: tuple[StopPlace, ...] = ()
    """All places at which vehicles wait for it."""

    @property
    def binds_car(self) -> bool:
        """Whether a car that follows a real one stops for it: a plan that no map holds is a guess
        for which nobody real would stop."""
        return self.why != "plan"

    @property
    def stops_cars(self) -> bool:
        """Whether its colour lets nobody pass."""
        return self.colour not in GOES_ON


class ShownLights(msgspec.Struct, frozen=True, kw_only=True):
    """All lights of the World in force at one stamp of the vehicle; a change is said at once.

    Virtual traffic drives by all of them, cars that follow a real one by those that bind it.
    """

    stamp_ns: int
    world_id: str | None
    """None where no World is in force, and no light is told of."""
    lights: tuple[ShownLight, ...] = ()
