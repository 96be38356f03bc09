"""Digital siblings: a second engine plays some futures of each round again; what comes of it."""

from __future__ import annotations

from typing import Literal

import msgspec

SiblingEngine = Literal["off", "multibody", "gazebo"]
WhichFuture = Literal["nominal", "worst"]
APART_AFTER_S = (1.0, 2.0, 4.0)
"""After how long it is told how far engines are apart. Chosen: the first three of HORIZONS_S; what
they differ in, tyres and load, has shown by then."""


class Siblings(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """A second engine that plays each round's nominal and worst future too; docs/engines.md."""

    engine: SiblingEngine = "off"
    """Whose physics: multibody, gazebo, or off."""
    share: float = 0.2
    """Of one core, the most that it may take; in lock step, where no clock runs, all are played."""

    @property
    def on(self) -> bool:
        """Whether there are any."""
        return self.engine != "off"

    def trouble(self) -> str | None:
        """Return what is wrong with it, None where nothing is."""
        return None if 0.0 < self.share <= 1.0 else f"share {self.share:g}: above 0, at most 1"


class SiblingFuture(msgspec.Struct, frozen=True, kw_only=True):
    """A future of a round on a second engine, beside the same one on MuJoCo."""

    round_id: int
    stamp_ns: int
    engine: SiblingEngine
    which: WhichFuture
    future_id: str
    """Of the round's future, as in the table of futures."""
    apart_1_s_m: float | None
    """Distance of both engines' cars; None beyond the horizon, and where a car is nowhere."""
    apart_2_s_m: float | None
    apart_4_s_m: float | None
    heading_rad: float | None
    """Of the second engine's car minus that of MuJoCo's, at the last of these instants."""
    collided: bool
    """Whether the car collides on MuJoCo, and on the second engine."""
    sibling_collided: bool
    matters: bool
    """Whether who drives by this round should know that engines disagree."""
    cpu_seconds: float
    """That the second engine's process took since its answer before, of one core."""
    took_s: float
    """From the question to its answer."""
    motion_sha256: str
    """Of the second engine's motion, which foretwin repeat finds again."""
