"""Where other road users will be along the ego's path if they keep their speed."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from foretwin.contracts.arrays import Array, Flags
from foretwin.contracts.frames import wrap_angle
from foretwin.geometry.frenet_path import FrenetPath
from foretwin.sim_worker.driver_model import SIGHT_M
from foretwin.sim_worker.planner_interface import PlannerView, SeenUsers

_KEEPS_LANE = 0.34
"""The sine of the angle to the road within which one drives along it, either way."""
_WAY_M, _BEYOND_M, _GAINS_MPS = 7.0, 15.0, 3.0
"""Who stays farther beside the way, or beyond what a car can reach of it, is no matter."""
_TURNS_ON_S, _TURNS_OFF_RADPS = 1.5, 0.12
_LEAST_SCALE = 0.2
"""Of distances along the path seen from the inside of a bend, where they lose their meaning."""


class Courses(NamedTuple):
    """Boxes of N others of S cars at K instants along the path, all (K, S, N).

    `arc_m`, infinite where there is none, and `offset_m` of their centres, `along_mps` and
    `across_mps`; half extents along and across the path `half_along_m`, `half_across_m`.
    """

    arc_m: Array
    offset_m: Array
    along_mps: Array
    across_mps: Array
    half_along_m: Array
    half_across_m: Array


class Changes(NamedTuple):
    """How others are changing their motion, each (S, R): braking, and yaw rate."""

    brakes_mps2: Array
    yaw_rate_radps: Array


def changes(before: SeenUsers, now: SeenUsers, *, passed_s: float) -> Changes | None:
    """Return what changed between two looks at the same others."""
    if before.poses.shape != now.poses.shape or passed_s <= 0.0:
        return None
    brakes = np.maximum(before.speed_mps - now.speed_mps, 0.0) / passed_s
    turns = wrap_angle(now.poses[..., 2] - before.poses[..., 2]) / passed_s
    known = np.isfinite(turns)
    return Changes(np.where(known, brakes, 0.0), np.where(known, turns, 0.0))


def _may_meet(view: PlannerView, users: SeenUsers, within_s: float) -> Flags:
    """(S, R) bool: who could come near the car's way, by present speeds, in that time."""
    along = within_s * users.speed_mps * np.cos(users.turned_rad)
    aside = within_s * np.abs(users.speed_mps * np.sin(users.turned_rad))
    ahead = users.arc_m - view.arc_m[:, None]
    reach = within_s * (view.states[:, 3] + _GAINS_MPS) + _BEYOND_M
    meets = np.abs(users.offset_m - view.offset_m[:, None]) < _WAY_M + aside
    meets &= ahead + np.minimum(along, 0.0) < reach[:, None]
    return np.asarray(meets & (ahead + np.maximum(along, 0.0) > -_BEYOND_M))


def courses(
    view: PlannerView, instants_s: Array, *, nearest: int, changing: Changes | None = None
) -> Courses | None:
    """Predict the `nearest` others of each car at even instants; None where nobody is near.

    Those along the path keep their angle to it, as lanes do; the rest go straight on, and those
    seen `changing` brake, and turn on for a while or else not any more. Who follows in the car's
    own lane is left out: not to be hit from behind is not the car's part.
    """
    users = view.users
    if users is None or users.poses.shape[1] == 0:
        return None
    away = np.square(users.poses[..., 0] - view.states[:, None, 0])
    away += np.square(users.poses[..., 1] - view.states[:, None, 1])
    turned = wrap_angle(users.turned_rad)
    along_lane = (np.abs(np.sin(turned)) < _KEEPS_LANE) & ~users.walks
    behind = along_lane & (np.cos(turned) > 0.0) & (users.arc_m < view.arc_m[:, None])
    behind &= np.abs(users.offset_m - view.offset_m[:, None]) < 2.0
    counts = (away < SIGHT_M**2) & ~behind & _may_meet(view, users, float(instants_s[-1]))
    if not counts.any():
        return None
    away = np.where(counts, away, np.inf)
    chosen = np.argsort(away, axis=1, kind="stable")[:, : min(nearest, int(counts.sum(1).max()))]

    def pick(values: Array) -> Array:
        return np.take_along_axis(values, chosen, axis=1)

    there = np.take_along_axis(counts, chosen, axis=1)
    brakes = yaw_rate = np.zeros(chosen.shape)
    if changing is not None:
        brakes, yaw_rate = pick(changing.brakes_mps2), pick(changing.yaw_rate_radps)
    now = _Boxes(
        arc_m=np.where(there, pick(users.arc_m), np.inf),
        offset_m=np.where(there, pick(users.offset_m), 0.0),
        turned_rad=np.where(there, pick(turned), 0.0),
        speed_mps=np.where(there, pick(users.speed_mps), 0.0),
        length_m=pick(users.size_m[..., 0]),
        width_m=pick(users.size_m[..., 1]),
        brakes_mps2=brakes,
        yaw_rate_radps=yaw_rate,
        keeps_lane=np.take_along_axis(along_lane, chosen, axis=1),
    )
    if changing is not None:
        now = _either_way(now, view.path)
    return _led_on(now, view.path, instants_s)


class _Boxes(NamedTuple):
    """Others as they are now, all (S, N); see `SeenUsers` and `Changes`."""

    arc_m: Array
    offset_m: Array
    turned_rad: Array
    speed_mps: Array
    length_m: Array
    width_m: Array
    brakes_mps2: Array
    yaw_rate_radps: Array
    keeps_lane: Flags


def _either_way(now: _Boxes, path: FrenetPath) -> _Boxes:
    """Return the boxes with those that turn off the road twice: they may turn on, or go straight.

    Nobody sees where a turn ends before it has.
    """
    bend = _bend(now.arc_m, path)
    along = _along(now.turned_rad, bend, now.offset_m)
    turns = np.abs(now.yaw_rate_radps - bend * along * now.speed_mps) >= _TURNS_OFF_RADPS
    turns &= np.isfinite(now.arc_m)
    now = now._replace(keeps_lane=now.keeps_lane & ~turns)
    columns = np.flatnonzero(turns.any(axis=0))
    if not len(columns):
        return now
    straight = _Boxes._make(values[:, columns] for values in now)._replace(
        arc_m=np.where(turns, now.arc_m, np.inf)[:, columns],
        yaw_rate_radps=np.zeros((len(turns), len(columns))),
    )
    return _Boxes._make(np.concatenate(pair, axis=1) for pair in zip(now, straight, strict=True))


def _bend(arc_m: Array, path: FrenetPath) -> Array:
    there = np.isfinite(arc_m)
    return path.at_nodes(path.curvature_pm, np.where(there, arc_m, 0.0))


def _along(turned_rad: Array, bend_pm: Array, offset_m: Array) -> Array:
    """Return how far along the path a box comes on each metre of its own way."""
    return np.asarray(np.cos(turned_rad) / np.maximum(1.0 - bend_pm * offset_m, _LEAST_SCALE))


def _led_on(now: _Boxes, path: FrenetPath, instants_s: Array) -> Courses:
    arc, offset, turned, speed, length, width = now[:6]
    rows: list[list[Array]] = []
    for k, passed_s in enumerate(np.diff(instants_s, prepend=0.0).tolist()):
        after = np.maximum(speed - passed_s * now.brakes_mps2, 0.0)
        mean, speed = 0.5 * (speed + after), after
        # The bend changes slowly: every second step is as the one before.
        if k % 2 == 0:
            bend = _bend(arc, path)
            goes_on = now.yaw_rate_radps if instants_s[k] < _TURNS_ON_S else 0.0
            turning = goes_on - bend * _along(turned, bend, offset) * mean
            turning = np.where(now.keeps_lane, 0.0, turning)
            middle = turned + passed_s * turning
            along, across = _along(middle, bend, offset), np.sin(middle)
            cos, sin = np.abs(np.cos(middle)), np.abs(across)
            half_along, half_across = length * cos + width * sin, length * sin + width * cos
        ahead, aside = along * mean, across * mean
        arc = arc + passed_s * ahead
        offset = offset + passed_s * aside
        turned = turned + passed_s * turning
        rows.append([arc, offset, ahead, aside, 0.5 * half_along, 0.5 * half_across])
    return Courses(*(np.stack(column) for column in zip(*rows, strict=True)))
