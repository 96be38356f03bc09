"""What the junction ahead asks of the car: the control on the connection that it takes."""

from __future__ import annotations

import math
from typing import Literal, NamedTuple

import numpy as np

from foretwin.contracts.arrays import Array
from foretwin.contracts.world import Connection, Control, World

Sign = Literal["signals", "stop", "give_way", "near_first", "oncoming_first", "priority", "open"]
"""Shapes that the display draws; `open` where nothing is known of who goes first."""

CONTROL_WORDS: dict[Control, tuple[Sign, str]] = {
    "signals": ("signals", "signals"),
    "stop": ("stop", "stop"),
    "all_way_stop": ("stop", "all-way stop"),
    "give_way": ("give_way", "give way"),
    "roundabout": ("give_way", "roundabout, give way"),
    "uncontrolled": ("open", "no signs"),
}
"""Of a whole junction, where it is not known yet by which lane the car comes."""
NEAR_M = 4.0
"""A path that keeps so near to a connection takes it."""
_TOGETHER_M = 2.0
"""Connections that begin so near to each other along a path begin at one place, side by side."""
_SAME_WAY_RAD = 0.6


class RightOfWay(NamedTuple):
    """What the display says and draws; the signal's group, by which its live colour is known."""

    sign: Sign
    text: str
    group_id: str | None = None


def of_junction(control: Control | None) -> RightOfWay:
    """Return what is known of a junction before the car's own lane is."""
    return RightOfWay("open", "") if control is None else RightOfWay(*CONTROL_WORDS[control])


def right_of_way(world: World, junction_id: str, path_m: Array) -> RightOfWay | None:
    """Return what counts for who drives along `path_m` (M, 2), in the World's frame.

    None where that is not known: the path does not reach the junction, and from where it ends the
    connections ahead differ.
    """
    mine = [one for one in world.connections if one.junction_id == junction_id]
    if not mine or len(path_m) < 2:
        return None
    path_m = _dense(path_m)
    along = [(_followed(one.centerline, path_m), one) for one in mine]
    taken = [(it, one) for it, one in along if it.away_m <= NEAR_M]
    if taken:
        # Through a roundabout there are several in a row; who waits, waits at the first.
        until_m = min(it.from_m for it, _ in taken) + _TOGETHER_M
        first = [(it.away_m, one) for it, one in taken if it.from_m <= until_m]
        return _asked(world, min(first, key=lambda pair: pair[0])[1])
    lanes = {lane.id: lane for lane in world.lanes}
    ahead = [
        one
        for one in mine
        if one.from_lane_id in lanes and _ends_on(lanes[one.from_lane_id].centerline, path_m)
    ]
    asked = {_asked(world, one)._replace(group_id=None) for one in ahead}
    if len(asked) != 1:
        return None
    groups = {one.signal_group_id for one in ahead}
    return asked.pop()._replace(group_id=groups.pop() if len(groups) == 1 else None)


def _asked(world: World, connection: Connection) -> RightOfWay:
    match connection.control:
        case "signal":
            return RightOfWay("signals", "signals", connection.signal_group_id)
        case "stop":
            return RightOfWay("stop", "stop")
        case "give_way":
            return RightOfWay("give_way", "give way")
    rules = {one.rule for one in world.conflicts if one.yields_id == connection.id}
    if rules & {"stop", "give_way", "roundabout", "priority_road", "lesser_road"}:
        return RightOfWay("give_way", "give way")
    if "near_side" in rules:
        near, far = "right", "left"
        if world.intersection.driving_side == "left":
            near, far = far, near
        return RightOfWay("near_first", f"{near} before {far}")
    if rules & {"turn_across", "u_turn"}:
        return RightOfWay("oncoming_first", "oncoming first")
    if rules:
        return RightOfWay("give_way", "give way")
    return RightOfWay("priority", "right of way")


class _Followed(NamedTuple):
    """How far a line leaves a path at most, and where along the path it begins."""

    away_m: float
    from_m: float


def _dense(path_m: Array) -> Array:
    """Return a line with points about half a metre apart."""
    steps = np.hypot(*np.diff(path_m, axis=0).T)
    along = np.concatenate([[0.0], np.cumsum(steps)])
    at = np.linspace(0.0, along[-1], max(2, int(along[-1] * 2.0)))
    return np.column_stack([np.interp(at, along, path_m[:, axis]) for axis in (0, 1)])


def _followed(line_m: Array, path_m: Array) -> _Followed:
    """Return how a line goes along a dense path, infinitely far where they go opposite ways."""
    away = np.hypot(*np.moveaxis(line_m[:, None] - path_m[None], -1, 0))
    first, last = int(away[0].argmin()), int(away[-1].argmin())
    away_m = math.inf if first > last else float(away.min(axis=1).max())
    return _Followed(away_m, 0.5 * first)


def _ends_on(line_m: Array, path_m: Array) -> bool:
    """Whether a path ends on a lane, in its direction."""
    line_m = _dense(line_m)
    away = np.hypot(*(line_m - path_m[-1]).T)
    at = int(away.argmin())
    step = line_m[min(at + 1, len(line_m) - 1)] - line_m[max(at - 1, 0)]
    own = path_m[-1] - path_m[max(len(path_m) - 5, 0)]
    if away[at] > NEAR_M or not np.hypot(*own):
        return False
    cosine = float(own @ step) / max(float(np.hypot(*own) * np.hypot(*step)), 1e-9)
    return bool(cosine > np.cos(_SAME_WAY_RAD))
