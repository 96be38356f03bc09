"""Roles of a vehicle in the mirror, and how its twin is held to reality."""

from __future__ import annotations

from typing import Literal, get_args

import msgspec

from foretwin.contracts.drive import ControlCommand, VehicleState
from foretwin.contracts.frames import LocalFrame
from foretwin.contracts.vehicle import VehicleParameters

Role = Literal["all", "twin", "shadow", "ghost"]
"""The twin is moved by physics under its vehicle's commands; the shadow stands where the vehicle
was measured, and others run into it; the ghost stands there too and collides with nothing; all is
the three at once."""
ROLES: tuple[Role, ...] = get_args(Role)
WHAT_STANDS = "world"
"""In touches the name of buildings, islands and whatever else does not move."""

Correction = Literal["free", "follow"]
"""A free twin runs on its commands alone and starts anew every few seconds; one that follows is
drawn towards the measured vehicle and never jumps."""
CORRECTIONS: tuple[Correction, ...] = get_args(Correction)


class UseRoles(msgspec.Struct, frozen=True, kw_only=True):
    """Tells the mirror what counts from `stamp_ns` on; its reply is the same message."""

    stamp_ns: int
    roles: dict[str, Role]
    """By vehicle id."""
    correction: Correction


_MOST_JERK_PER_S = 60.0
"""Beyond it, a physics step is too long for the law; see foretwin.sim_worker.mirror.follower."""


class FollowLimits(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """How hard a following twin may be drawn: along and across the road, and in yaw."""

    accel_mps2: float = 1.0
    """Along and across the road."""
    jerk_mps3: float = 2.0
    """How fast that may change."""
    yaw_accel_radps2: float = 0.3
    """Of turning."""
    yaw_jerk_radps3: float = 0.6
    """How fast that may change."""
    reach_m: float = 20.0
    """A twin farther from its vehicle than this is lost, and starts anew."""

    def trouble(self) -> str | None:
        """Return what is wrong with the limits, None where nothing is."""
        for name in self.__struct_fields__:
            if not 0.0 < getattr(self, name) < 1e6:
                return f"{name} {getattr(self, name)}: above 0"
        pairs = (
            ("jerk_mps3", self.jerk_mps3, self.accel_mps2),
            ("yaw_jerk_radps3", self.yaw_jerk_radps3, self.yaw_accel_radps2),
        )
        for name, jerk, accel in pairs:
            if jerk > _MOST_JERK_PER_S * accel:
                return f"{name} {jerk}: at most {_MOST_JERK_PER_S:g} times the acceleration"
        return None


class OtherVehicle(msgspec.Struct, frozen=True, kw_only=True):
    """A vehicle beside the car: a state of it, and what it was told since the one before."""

    state: VehicleState
    commands: tuple[ControlCommand, ...] = ()
    clock_std_s: float = 0.0
    """How sure its stamp is by the car's clock."""


class OtherVehicles(msgspec.Struct, frozen=True, kw_only=True):
    """All that is new of the vehicles beside the car as it is in the state of `stamp_ns`."""

    stamp_ns: int
    heard: tuple[OtherVehicle, ...]


class VehicleEncounter(msgspec.Struct, frozen=True, kw_only=True):
    """Two vehicles that came near one another: how near, when, and whether they touched."""

    one: str
    other: str
    stamp_ns: int
    """When their outlines came within 10 m, by the car's clock."""
    end_stamp_ns: int
    """When they were 20 m apart again, or when one was gone."""
    least_m: float
    """Between their outlines; 0 where they touched."""
    least_stamp_ns: int
    """When they were nearest, or began to touch."""
    uncertain_m: float
    """Of that distance: one standard deviation from both positions and clocks, and on top of it the
    bound of who was reckoned then."""
    touched: bool
    """Whether their outlines overlapped."""


class JoinRequest(msgspec.Struct, frozen=True, kw_only=True):
    """Somebody asks to speak as a vehicle beside the car, and again every second while it does."""

    instance: str
    """A word of its own for as long as it lives."""
    scale: float
    """Of the anchor between its lot and the World."""
    leaves: bool = False


class JoinReply(msgspec.Struct, frozen=True, kw_only=True):
    """Whether it may: `refused` says why not, `trouble` what is missing until now."""

    refused: str = ""
    trouble: str = ""
    drive_frame: LocalFrame | None = None
    """Of the run; None before it may begin to speak."""
    clock: str = ""
    """How its clock stands to the car's, in words."""
    over: bool = False
    """Whether its last word was heard."""


class CastVehicle(msgspec.Struct, frozen=True, kw_only=True):
    """A vehicle beside the car as the mirror knows it from the start."""

    vehicle_id: str
    vehicle: VehicleParameters
    commands_recorded: bool = False


class MirrorCast(msgspec.Struct, frozen=True, kw_only=True):
    """Who is in the mirror besides the car, and how hard twins may be drawn."""

    others: tuple[CastVehicle, ...] = ()
    limits: FollowLimits = FollowLimits()
