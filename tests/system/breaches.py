"""What a car on a lot may do wrong while it is shown things, by kinds, and cases drawn of them.

Lot metres are along and to the left of the anchor's direction, from its point.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, NamedTuple

import msgspec
import numpy as np
import shapely
from msgspec.structs import replace

from foretwin.contracts.frames import GeoPoint, LocalFrame, geo_pose
from foretwin.sim_worker.vehicle.parameters import load_vehicle
from foretwin.telemetry.ros2.lot_guard import APART_M
from tests.telemetry.lot_car.test_braking import ANCHOR

S = 10**9
CAR = load_vehicle(None)
REACH_M = math.hypot(CAR.length_m.value - CAR.rear_overhang_m.value, 0.5 * CAR.width_m.value)
"""From base_link to a corner of the car's front."""
WIDE_M = 900.0
WAY_M = 150.0
DIALECTS = "ros2dds", "rmw_zenoh"
LISTS = "PredictedObjects", "DetectedObjects", "TrackedObjects"


class Kind(NamedTuple):
    """One way of doing wrong."""

    why: str
    """What the gateway says of it."""
    amounts: tuple[float, float]
    """Between which it is drawn how much; in metres, seconds or nothing."""
    allowed_s: float = 0.0
    """Until a sample that is missing or wrong is due."""
    by_its_way: bool = False
    """Whether the car is in the wrong from a place on, where its estimate may be a bit earlier."""
    fence: Callable[[float], list[tuple[float, float]]] | None = None
    """Corners in lot metres by the amount, of which the car comes too near as it drives on."""


def _ahead(east_m: float) -> list[tuple[float, float]]:
    return [(-60.0, -200.0), (east_m, -200.0), (east_m, 200.0), (-60.0, 200.0)]


def _narrow(north_m: float) -> list[tuple[float, float]]:
    return [(-60.0, -200.0), (WIDE_M, -200.0), (WIDE_M, north_m), (-60.0, north_m)]


def _slanted(east_m: float) -> list[tuple[float, float]]:
    """One side crosses the way at a slant, from 60 m beside the car's beginning."""
    return [(-60.0, -200.0), (WIDE_M, -200.0), (east_m, 0.0), (0.0, 60.0), (-60.0, 60.0)]


KINDS = {
    "comes too near to the fence ahead": Kind(
        "the fence is .* off", (48.0, 90.0), 0.0, True, _ahead
    ),
    "gets too fast for a narrow lot": Kind("the fence is .* off", (16.0, 26.0), 0.0, True, _narrow),
    "nears the fence at its side": Kind("the fence is .* off", (80.0, 130.0), 0.0, True, _slanted),
    "stands somewhere else": Kind("fence|apart", (80.0, 400.0), 0.1),
    "stands beside itself": Kind("apart", (12.0, 30.0), 0.1),
    "says an old position again": Kind("apart", (0.0, 0.0), 0.1, True),
    "falls silent": Kind("for 150 ms", (0.0, 0.0)),
    "loses its positions": Kind("positions are overdue", (0.0, 0.0), 0.1),
    "says positions that are none": Kind("positions are overdue", (0.0, 0.0), 0.1),
    "is heard late": Kind("for 150 ms", (0.5, 2.0)),
    "sets its clock ahead": Kind("clock|no new state", (5.0, 60.0)),
    "sets its clock back": Kind("clock|no new state", (5.0, 60.0)),
    "has a clock that stands": Kind("clock|no new state", (0.0, 0.0)),
    "has nobody in charge for a while": Kind("no word|no new state", (0.5, 2.0)),
    # Who comes after it knows of no position at first.
    "loses who is in charge": Kind("no word|no new state|positions are overdue", (0.0, 0.0)),
    "has a gateway that is halted": Kind("no word|no new state|for 150 ms", (0.5, 2.0)),
}
HALTED = {
    "has nobody in charge for a while": "orchestrator", "loses who is in charge": "orchestrator",
    "has a gateway that is halted": "gateway",
}  # fmt: skip
"""Whose process is halted for the amount of seconds, or killed where that is 0."""


class Breach(msgspec.Struct, frozen=True, kw_only=True):
    """One case: what goes wrong, by how much, how long after the first list, and to whom."""

    kind: str
    amount: float
    after_s: float
    speed_mps: float
    dialect: str
    lists: str

    @property
    def corners(self) -> list[tuple[float, float]]:
        """Of the fence, in lot metres."""
        fence = KINDS[self.kind].fence
        return _ahead(WIDE_M) if fence is None else fence(self.amount)

    @property
    def fence_deg(self) -> tuple[tuple[float, float], ...]:
        """The same by latitude and longitude."""
        places = [lot_place(*one) for one in self.corners]
        return tuple((one.lat_deg, one.lon_deg) for one in places)

    def __str__(self) -> str:
        return (
            f"{self.kind} ({self.amount:.1f}; {self.after_s:.1f} s on; {self.speed_mps:.1f} m/s; "
            f"{self.dialect}, {self.lists})"
        )


def drawn(count: int, *, seed: int) -> list[Breach]:
    """Return so many cases: each kind as often as the others, one at most oftener."""
    random = np.random.default_rng(seed)
    kinds: list[str] = []
    while len(kinds) < count:
        kinds += random.permutation(list(KINDS)).tolist()
    return [
        Breach(
            kind=kind,
            amount=float(random.uniform(*KINDS[kind].amounts)),
            after_s=float(random.uniform(3.0, 7.0)),
            speed_mps=float(random.uniform(6.0, 10.0)),
            dialect=DIALECTS[number % 2],
            lists=str(random.choice(LISTS)),
        )
        for number, kind in enumerate(kinds[:count])
    ]


def lot_place(x_m: float, y_m: float) -> GeoPoint:
    """Return a place on the lot by lot metres."""
    cos, sin = math.cos(ANCHOR.lot.yaw_rad), math.sin(ANCHOR.lot.yaw_rad)
    return geo_pose(ANCHOR.lot.frame, cos * x_m - sin * y_m, sin * x_m + cos * y_m, 0.0).position


class Spoiler:
    """What is made of a car's samples from an instant on, and when that is wrong by its true way.

    Fences are of no sample: there nothing is spoilt, and all depends on the way.
    """

    def __init__(self, breach: Breach) -> None:
        self.breach, self._first = breach, dict[str, Any]()
        self._edge = shapely.Polygon(breach.corners).exterior
        self._from_s_m = 0.0

    @property
    def late_ns(self) -> int:
        """By how much samples are late."""
        return round(self.breach.amount * S) if self.breach.kind == "is heard late" else 0

    def begin(self, s_m: float) -> None:
        """Take how far the car is as it begins."""
        self._from_s_m = s_m

    def is_wrong(self, s_m: float, speed_mps: float, *, begun: bool) -> bool:
        """Whether the car is in the wrong by now, without anything that the guard knows."""
        if KINDS[self.breach.kind].fence is not None:
            left_m = self._edge.distance(shapely.Point(s_m, 0.0)) - REACH_M
            return left_m < 2.5 * speed_mps + speed_mps**2 / 6.8
        if self.breach.kind == "says an old position again":
            return begun and s_m - self._from_s_m > APART_M + REACH_M
        return begun

    def spoilt(self, channel: str, message: Any) -> Any:
        """Return what is said instead of a sample; None for nothing."""
        match self.breach.kind:
            case "falls silent":
                return None
            case "sets its clock ahead":
                return replace(message, stamp_ns=message.stamp_ns + round(self.breach.amount * S))
            case "sets its clock back":
                return replace(message, stamp_ns=message.stamp_ns - round(self.breach.amount * S))
            case "has a clock that stands":
                first = self._first.setdefault("", message)
                return replace(message, stamp_ns=first.stamp_ns)
        return message if channel != "gnss" else self._position(message)

    def _position(self, message: Any) -> Any:
        at: GeoPoint = message.position
        match self.breach.kind:
            case "loses its positions":
                return None
            case "says positions that are none":
                return replace(message, position=GeoPoint(math.nan, math.nan))
            case "says an old position again":
                return replace(message, position=self._first.setdefault("gnss", at))
            case "stands somewhere else" | "stands beside itself":
                there = geo_pose(LocalFrame(at), 0.0, self.breach.amount, 0.0)
                return replace(message, position=there.position)
        return message
