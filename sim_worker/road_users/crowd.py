"""Who is on the road, as arrays: up to R road users in each of S futures, and the ego."""

from __future__ import annotations

from typing import NamedTuple

from foretwin.contracts.arrays import Array, Flags, Indices


class Crowd(NamedTuple):
    """Who is on the road besides the ego; every field (S, R).

    `path_of` is a place in the `PathTable`; `lateral_m` lies to its left. `lawful` ones react to
    others, each with its own manners; `desired_mps` is their speed on a free road, and `briskness`
    multiplies an ordinary driver's accelerations in bends. The rest move as `pace_of` in the
    `Paces` says, or, where it is -1, not at all; from `brakes_at_s` on, infinite for most, they
    brake by `brakes_by_mps2`. `walks` is true of those who keep to no lane, `kinds` are places in
    `KIND_NAMES`, `hidden_by` the column of who hides it, or -1. `known` ones were perceived by the
    real car: no wall of the map hides them.
    """

    present: Flags
    lawful: Flags
    length_m: Array
    width_m: Array
    path_of: Indices
    pace_of: Indices
    lateral_m: Array
    start_arc_m: Array
    start_speed_mps: Array
    desired_mps: Array
    accel_mps2: Array
    decel_mps2: Array
    time_gap_s: Array
    briskness: Array
    reaction_s: Array
    lag_s: Array
    brakes_at_s: Array
    brakes_by_mps2: Array
    walks: Flags
    kinds: Indices
    known: Flags
    hidden_by: Indices


class EgoBoxes(NamedTuple):
    """The ego as others see it: box centres (S, 3) x, y, yaw, speeds (S,), places on its path (S,).

    `path_of` is the ego path's place in the table; `arc_m` that of the box centre.
    """

    poses: Array
    speed_mps: Array
    path_of: int
    arc_m: Array
    length_m: float
    width_m: float
