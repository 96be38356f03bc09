"""Roles of a vehicle in the mirror, and how its twin is held to reality."""

from __future__ import annotations

from typing import Literal, get_args

import msgspec

Role = Literal["all", "twin", "shadow", "ghost"]
"""The twin is moved by physics under its vehicle's commands; the shadow stands where the vehicle
was measured, and others run into it; the ghost stands there too and collides with nothing; all is
the three at once."""
ROLES: tuple[Role, ...] = get_args(Role)

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
