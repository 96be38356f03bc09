"""The same seconds simulated and driven, and what is known of the drive in them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

from foretwin.contracts.arrays import Array, Stamps
from foretwin.contracts.drive import SignalColour


class Users(NamedTuple):
    """Other road users at N instants: `poses` (N, R, 3), NaN where one is not there, speeds (N, R),
    length and width (R, 2)."""

    poses: Array
    speed_mps: Array
    size_m: Array


class Heard(NamedTuple):
    """What a signal group was heard to show: stamps (M,), rising, and colours."""

    stamps_ns: Stamps
    colours: tuple[SignalColour, ...]


class Window(NamedTuple):
    """The same seconds simulated and driven, in one World: states (N, 8) at `time_s` (N,).

    `known_users` says whether the car reported road users throughout; `position_std_m` is the
    greatest while it drove, None where unknown. `driven_std` (N, 2) are the standard deviations of
    driven speed and yaw, infinite where unknown; `state_period_s` is the longest time between two
    states. `antenna_known` says whether the source tells where on the car its positions are of,
    `closed_road` that the car came onto a way which the map has, but gives to no car.
    """

    round_id: int
    stamp_ns: int
    junction_id: str
    world_id: str
    time_s: Array
    simulated: Array
    simulated_users: Users
    driven: Array
    driven_users: Users
    path_xy_m: Array
    heard: Mapping[str, Heard]
    known_users: bool
    position_std_m: float | None
    driven_std: Array
    state_period_s: float
    antenna_known: bool
    closed_road: bool
