"""One frame of the display: all that the page shows at an instant, complete in itself.

Complete, so that a page may miss any number of frames and is right with the next.
"""

from __future__ import annotations

import msgspec

from foretwin.contracts.lights import WhyShown
from foretwin.viewer.copilot.alerts import Kind
from foretwin.viewer.copilot.right_of_way import Sign
from foretwin.viewer.danger import Level

Points = list[list[float]]


class AheadLight(msgspec.Struct, frozen=True, kw_only=True):
    """The light for the car at the junction ahead, and by whose word it shows its colour."""

    group: str
    colour: str
    why: WhyShown


class AheadFrame(msgspec.Struct, frozen=True, kw_only=True):
    """The junction ahead; `in_s` is None while the car stands before it."""

    name: str
    arrival: str
    span: str
    in_s: float | None
    away_m: float | None
    sign: Sign
    control: str
    colour: str = ""
    """Of the light for the car, where it is heard or set by hand."""
    light: AheadLight | None = None
    """Whatever it shows, by plan too; None where the car's lane is not known, or has none."""


class DangerFrame(msgspec.Struct, frozen=True, kw_only=True):
    """The danger that ranks first: `path` is the car's in that future, `other` whom it meets."""

    what: str
    odds: str
    in_s: float
    hits: bool
    path: Points
    other: Points


class AlertFrame(msgspec.Struct, frozen=True, kw_only=True):
    """Something that is wrong with the run."""

    kind: Kind
    text: str
    grave: bool


class SeenFrame(msgspec.Struct, frozen=True, kw_only=True):
    """A road user that the car detects."""

    kind: str
    at: list[float]
    yaw: float
    size: list[float]


class PageFrame(msgspec.Struct, frozen=True, kw_only=True):
    """Lengths in metres and angles in radians of the drive's frame; `pose` is x, y, yaw, speed."""

    drive_s: float
    """Drive time of the newest state."""
    level: Level
    sentence: str
    speed_kmh: float | None
    pose: list[float] | None
    twin_pose: list[float] | None
    ahead: AheadFrame | None
    danger: DangerFrame | None
    more: int
    """Dangers besides the first."""
    twin: str
    twin_detail: str
    twin_well: bool
    alerts: list[AlertFrame]
    world_id: str | None
    nominal: Points
    others: list[Points]
    """The car's paths in futures that rank after the first."""
    seen: list[SeenFrame]
    lights: dict[str, str]
    """Colours that are heard or set by hand, by group."""
    roles: dict[str, str]
    marks: int
    round_age_s: float | None
    """How old the car's state is that the round began with, in drive time."""
    pace: str
    """How many futures are run, where the machine is too slow for all."""
    virtual: str = ""
    """Whether a car on a lot is shown what is virtual, and why not."""
    round_old: bool = False
    """It is shown still, and said to be old."""
    round_for_s: float | None = None
    """For how long after this frame its round may be shown at all."""
