"""Road users that are simulated, from whoever says them, as one list towards a driving stack."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import msgspec
import numpy as np

from foretwin.contracts.drive import RoadUser, RoadUserKind, RoadUsers
from foretwin.contracts.frames import GeoPoint, LocalFrame, geo_from_local
from foretwin.contracts.too_old import USERS_FOR_NS
from foretwin.telemetry.logs.log import is_finite

_MOST_SPEED_MPS, _MOST_SIZE_M = 100.0, 50.0
_STEP_BACK_NS = 1_000_000_000
"""A stamp that goes back so far is the vehicle's clock set anew."""


class UnfitError(ValueError):
    """Road users that must not go out; the text says why, in few different words."""


class PlacedObject(
    msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True, rename={"user_id": "id"}
):
    """A virtual road user of the mapping: it stands, or goes to and fro along its yaw."""

    user_id: str
    """Under which others see it."""
    kind: RoadUserKind
    """What it is."""
    lat_deg: float
    """Of its centre."""
    lon_deg: float
    """Of its centre."""
    alt_m: float = 0.0
    """Above the ellipsoid; 0: on the ground of `map`."""
    yaw_deg: float = 0.0
    """Counter-clockwise from east."""
    speed_mps: float = 0.0
    """With which it goes to and fro; 0 stands."""
    way_m: float = 0.0
    """From its place to where it turns round."""
    length_m: float = 4.5
    """Along its yaw."""
    width_m: float = 1.8
    """Across it."""

    def validate(self) -> None:
        """Raise ValueError naming the key at fault."""
        if not (abs(self.lat_deg) < 90.0 and abs(self.lon_deg) <= 180.0):
            raise ValueError(f"lat_deg, lon_deg {self.lat_deg}, {self.lon_deg}: degrees")
        if not all(map(math.isfinite, (self.alt_m, self.yaw_deg))):
            raise ValueError("alt_m, yaw_deg: finite numbers")
        for name in ("length_m", "width_m"):
            if not 0.0 < getattr(self, name) < _MOST_SIZE_M:
                raise ValueError(f"{name} {getattr(self, name)}: above 0 and below 50")
        if not (0.0 <= self.speed_mps <= 50.0 and 0.0 <= self.way_m <= 1000.0):
            raise ValueError("speed_mps 0 to 50 and way_m 0 to 1000")
        if self.speed_mps > 0.0 and self.way_m == 0.0:
            raise ValueError("way_m: how far it goes before it turns round")

    def at(self, time_s: float) -> RoadUser:
        """Return where it is so long after it set out."""
        driven = self.speed_mps * time_s % (2.0 * self.way_m) if self.way_m else 0.0
        back = driven > self.way_m
        user = RoadUser(
            user_id=self.user_id,
            kind=self.kind,
            virtual=True,
            position=GeoPoint(self.lat_deg, self.lon_deg, self.alt_m),
            yaw_rad=math.radians(self.yaw_deg),
            speed_mps=self.speed_mps,
            length_m=self.length_m,
            width_m=self.width_m,
        )
        there = moved(user, 2.0 * self.way_m - driven if back else driven)
        turned = math.remainder(user.yaw_rad + (math.pi if back else 0.0), math.tau)
        return msgspec.structs.replace(there, yaw_rad=turned)


class _Latest(NamedTuple):
    heard_ns: int
    stamp_ns: int
    user: RoadUser


class VirtualObjects:
    """Keeps the last word on each road user, so that several senders do not undo one another."""

    def __init__(self, *, at_most: int, placed: Sequence[PlacedObject] = ()) -> None:
        """`placed` are there from the first state of the vehicle on."""
        self._at_most, self._placed = at_most, placed
        self._begun_ns: int | None = None
        self._latest: dict[str, _Latest] = {}
        self._newest_ns = 0

    @property
    def has_own(self) -> bool:
        """Whether the mapping itself places any."""
        return bool(self._placed)

    def own(self, stamp_ns: int) -> RoadUsers:
        """Return the road users of the mapping at the vehicle's time."""
        if self._begun_ns is None or stamp_ns < self._begun_ns:
            self._begun_ns = stamp_ns
        time_s = (stamp_ns - self._begun_ns) * 1e-9
        return RoadUsers(stamp_ns=stamp_ns, users=tuple(one.at(time_s) for one in self._placed))

    def nobody(self) -> RoadUsers:
        """Return the last list of all: that nobody is there any more."""
        return RoadUsers(stamp_ns=self._newest_ns, users=())

    def take(self, message: RoadUsers, *, now_ns: int) -> RoadUsers:
        """Return all that are known at one stamp; `now_ns` is the host's clock.

        The stamp is the message's, or that of the list before where that is newer: all are moved on
        to it. Raises UnfitError where one is not marked as virtual, not finite or of no vehicle's
        size or speed, or where they are too many.
        """
        if not all(user.virtual for user in message.users):
            raise UnfitError("road users that are not marked as virtual")
        if not is_finite(message):
            raise UnfitError("virtual objects that are not finite")
        if not all(map(_is_possible, message.users)):
            raise UnfitError("virtual objects of an impossible size or speed")
        fresh = self._fresh(now_ns)
        fresh |= {user.user_id: _Latest(now_ns, message.stamp_ns, user) for user in message.users}
        if len(fresh) > self._at_most:
            raise UnfitError("virtual objects that are too many")
        self._latest = fresh
        stamp_ns = message.stamp_ns
        if 0 < self._newest_ns - stamp_ns < _STEP_BACK_NS:
            stamp_ns = self._newest_ns
        self._newest_ns = stamp_ns
        return _all_at(fresh, stamp_ns)

    def at(self, stamp_ns: int, *, now_ns: int) -> RoadUsers:
        """Return all that are known at another stamp, that of what the car itself sees."""
        return _all_at(self._fresh(now_ns), stamp_ns)

    def _fresh(self, now_ns: int) -> dict[str, _Latest]:
        return {n: one for n, one in self._latest.items() if now_ns - one.heard_ns <= USERS_FOR_NS}


def _all_at(latest: dict[str, _Latest], stamp_ns: int) -> RoadUsers:
    users = tuple(_at(one, stamp_ns) for _, one in sorted(latest.items()))
    return RoadUsers(stamp_ns=stamp_ns, users=users)


def _at(latest: _Latest, stamp_ns: int) -> RoadUser:
    user, older_s = latest.user, (stamp_ns - latest.stamp_ns) * 1e-9
    return moved(user, user.speed_mps * older_s) if 0.0 < abs(older_s) < 1.0 else user


def moved(user: RoadUser, way_m: float) -> RoadUser:
    """Return the road user so far ahead along its yaw."""
    step = way_m * np.array([math.cos(user.yaw_rad), math.sin(user.yaw_rad)])
    lat_deg, lon_deg = geo_from_local(LocalFrame(user.position), step).tolist()
    return msgspec.structs.replace(user, position=GeoPoint(lat_deg, lon_deg, user.position.alt_m))


def _is_possible(user: RoadUser) -> bool:
    sizes_m = (user.length_m, user.width_m)
    return abs(user.speed_mps) <= _MOST_SPEED_MPS and all(0.0 < m < _MOST_SIZE_M for m in sizes_m)
