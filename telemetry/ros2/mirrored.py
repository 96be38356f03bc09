"""Vehicles of the mirror, each in its role, as virtual road users for a driving stack."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import msgspec
import numpy as np

from foretwin.contracts.drive import RoadUser, RoadUsers
from foretwin.contracts.frames import LocalFrame, geo_pose
from foretwin.contracts.simulation import MirrorSample, PlaneState
from foretwin.contracts.too_old import USERS_FOR_NS
from foretwin.contracts.vehicle import VehicleParameters, kind_by_length
from foretwin.telemetry.ros2.virtual_objects import UnfitError

OWN_TWIN = "twin of the car"
"""The id of the car's own twin among road users."""


class Mirrored(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Who of the mirror goes out among virtual objects; nobody, unless it is asked for."""

    own_twin: bool = False
    """The car's own; never towards the vehicle, whose own place it fills."""
    vehicles: tuple[str, ...] = ()
    """Ids of vehicles beside the car; each while it is a twin or a shadow."""

    def __bool__(self) -> bool:
        return self.own_twin or bool(self.vehicles)


class _Size(NamedTuple):
    length_m: float
    width_m: float
    rear_overhang_m: float


class MirroredObjects:
    """Turns what the mirror says into road users.

    `car` gives the size of the car's own twin, `drive_frame` is that of the mirror, `alt_m` that of
    the ground.
    """

    def __init__(
        self,
        wanted: Mirrored,
        *,
        car: VehicleParameters | None,
        drive_frame: LocalFrame,
        alt_m: float,
    ) -> None:
        """Raises ValueError where the car's own twin shall go out and its size is not given."""
        if wanted.own_twin and car is None:
            raise ValueError("the car's own twin needs the car's size")
        self._wanted, self._car = wanted, car
        self._frame, self._alt_m = drive_frame, alt_m
        self._now_ns: int | None = None

    def take_state(self, stamp_ns: int) -> None:
        """Take the stamp of the car's newest state."""
        self._now_ns = stamp_ns

    def users(self, sample: MirrorSample) -> RoadUsers:
        """Return who is there in a role that others meet; ghosts meet nobody.

        Raises UnfitError where the mirror lags so far behind the car that it tells of the past.
        """
        if self._now_ns is not None and self._now_ns - sample.stamp_ns > USERS_FOR_NS:
            raise UnfitError("a mirror that lags behind the car")
        return RoadUsers(stamp_ns=sample.stamp_ns, users=tuple(self._there(sample)))

    def _there(self, sample: MirrorSample) -> Iterator[RoadUser]:
        if self._wanted.own_twin and sample.role in ("all", "twin"):
            assert self._car is not None
            car = self._car
            size = _Size(car.length_m.value, car.width_m.value, car.rear_overhang_m.value)
            yield self._user(OWN_TWIN, sample.twin, size)
        for one in sample.others:
            if one.vehicle_id in self._wanted.vehicles and one.role in ("twin", "shadow"):
                size = _Size(one.length_m, one.width_m, one.rear_overhang_m)
                yield self._user(f"mirrored {one.vehicle_id}", one.shown, size)

    def _user(self, user_id: str, base: PlaneState, size: _Size) -> RoadUser:
        ahead_m = 0.5 * size.length_m - size.rear_overhang_m
        at = geo_pose(
            self._frame,
            base.x_m + ahead_m * float(np.cos(base.yaw_rad)),
            base.y_m + ahead_m * float(np.sin(base.yaw_rad)),
            base.yaw_rad,
            alt_m=self._alt_m,
        )
        return RoadUser(
            user_id=user_id,
            kind=kind_by_length(size.length_m),
            virtual=True,
            position=at.position,
            yaw_rad=at.yaw_rad,
            speed_mps=base.speed_mps,
            length_m=size.length_m,
            width_m=size.width_m,
        )


def without_own_twin(users: RoadUsers) -> RoadUsers:
    """Return the road users that may go towards the vehicle."""
    return RoadUsers(
        stamp_ns=users.stamp_ns,
        users=tuple(user for user in users.users if user.user_id != OWN_TWIN),
    )
