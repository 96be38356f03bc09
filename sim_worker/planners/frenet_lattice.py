"""A planner that samples motions along and across its path and takes the best one free of others.

Werling, Ziegler, Kammel, Thrun (2010), Optimal trajectory generation for dynamic street scenarios
in a Frenet frame, ICRA: quartic and quintic polynomials of time along the path (keeping a speed,
stopping at a line, following) and across it (offsets), combined, checked, and rated by jerk, time
and distance from what is wanted. All cars and all candidates are arrays.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from contracts.arrays import Array
from sim_worker.planners.base import PlannerOutput, PlannerView
from sim_worker.planners.giving_way import wait_arcs
from sim_worker.planners.path import SPACING_M
from sim_worker.planners.polynomials import Floats, Motions, joined, to_place, to_speed
from sim_worker.planners.prediction import courses
from sim_worker.planners.tracking import front_from_base_m, pure_pursuit
from sim_worker.vehicle.actuation import resistance_mps2
from sim_worker.vehicle.planar import box_centre_from_base_m

REPLAN_S = 0.5
HORIZON_S, _INSTANTS = 4.0, 12
_INSTANTS_S: Array = np.linspace(HORIZON_S / _INSTANTS, HORIZON_S, _INSTANTS)
_ROUGH_INSTANTS_S = _INSTANTS_S.astype(np.float32)[:, None, None]
_SPEED_SHARES = np.array([1.0, 0.8, 0.6, 0.35, 0.0])
_SPEED_TIMES_S = np.array([2.5, 5.0])
_ASIDE_M = np.array([0.0, -0.5, 0.5, -1.0, 1.0, -1.5, 1.5])
_ASIDE_TIMES_S = np.array([2.0, 3.5])
_NEAREST = 6
_MAX_ACCEL_MPS2, _MAX_DECEL_MPS2 = 2.5, 7.0
_COMFORT_DECEL_MPS2, _LATERAL_ACCEL_MPS2, _MAX_LATERAL_MPS2 = 2.0, 2.5, 4.0
_LINE_GAP_M, _STANDSTILL_GAP_M, _TIME_GAP_S = 1.0, 2.0, 1.2
_ALONG_MARGIN_M, _ACROSS_MARGIN_M = 0.8, 0.4
_SLOPE = 0.3
"""Of the own speed, how fast a car may move across its path."""
_WEIGHT_SPEED, _WEIGHT_ACCEL, _WEIGHT_JERK = 0.15, 0.25, 0.05
_WEIGHT_ASIDE, _WEIGHT_ACROSS_JERK = 0.6, 0.1
_FORBIDDEN, _CROSSES_LINE, _COLLIDES = 1e3, 300.0, 100.0
_LOOKAHEAD_S, _PREVIEW_S = 0.6, 0.1
_SPEED_GAIN, _PLACE_GAIN = 1.2, 0.3
_HOLD_MPS, _HOLD_MPS2 = 0.3, -2.0

_Planned = tuple[Floats, Floats, Floats, Floats]


class FrenetLattice:
    """Evades within its lane, follows, stops for lights and others, and gives way.

    Asked without memory, it plans at every tick; driving a job it does so every half second.
    """

    def plan(self, view: PlannerView) -> PlannerOutput:
        """Answer one control tick."""
        return LatticeDriver(preview_s=REPLAN_S).plan(view)

    def begin(self, count: int) -> LatticeDriver:
        """Return what drives the cars of one job."""
        return LatticeDriver()


class LatticeDriver:
    """Follows the motions chosen last, and chooses anew every half second."""

    remarks: Mapping[int, str] = {}

    def __init__(self, *, preview_s: float = _PREVIEW_S) -> None:
        """`preview_s`: over so much of the plan's beginning its acceleration is taken, as the
        plan begins with the present one."""
        self._preview_s = preview_s
        self._chosen: tuple[Motions, Motions] | None = None
        self._since_s = 0.0

    def plan(self, view: PlannerView) -> PlannerOutput:
        """Answer one control tick."""
        chosen, passed_s = self._chosen, view.time_s - self._since_s
        if chosen is None or passed_s > REPLAN_S - 1e-6:
            before = None if chosen is None else _now(*chosen, passed_s)
            self._chosen = chosen = choose(view, before)
            self._since_s, passed_s = view.time_s, 0.0
        along, across = chosen
        now = np.asarray(passed_s)
        place, speed, _ = along.at(now)
        accel = (along.at(now + self._preview_s)[1] - speed) / self._preview_s
        offset = np.asarray(across.place_at(now + _LOOKAHEAD_S), dtype=np.float64)
        angle = pure_pursuit(view._replace(desired_offset_m=offset))
        present = view.states[:, 3]
        command = accel + _SPEED_GAIN * (speed - present) + _PLACE_GAIN * (place - view.arc_m)
        command = np.minimum(np.maximum(command, -_MAX_DECEL_MPS2), _MAX_ACCEL_MPS2)
        hold = (present < _HOLD_MPS) & (speed < _HOLD_MPS) & (accel < _HOLD_MPS)
        command = command + resistance_mps2(view.vehicle, present)
        return PlannerOutput(np.where(hold, _HOLD_MPS2, command), angle)


def _now(along: Motions, across: Motions, passed_s: float) -> _Planned:
    """Return the acceleration along, and place, speed, acceleration across, that were planned."""
    at = np.asarray(passed_s)
    return (along.at(at)[2], *across.at(at))


def choose(view: PlannerView, before: _Planned | None = None) -> tuple[Motions, Motions]:
    """Return the best motions of S cars along and across the path, from now on.

    `before` is what the last plan has for now: acceleration along, and place, speed, acceleration
    across the path.
    """
    states = view.states
    slant = states[:, 2] - view.path.pose_at(view.arc_m).yaw_rad
    speed = np.maximum(states[:, 3] * np.cos(slant), 0.0)
    accel: Floats = states[:, 7]
    offset: Floats = view.offset_m
    slide: Floats = states[:, 3] * np.sin(slant)
    push: Floats = np.zeros_like(slide)
    if before is not None:
        accel = before[0]
        keeps = np.abs(before[1] - offset) < 0.4
        offset, slide, push = (
            np.where(keeps, planned, present)
            for planned, present in zip(before[1:], (offset, slide, push), strict=True)
        )
    accel = np.where(speed < 0.1, np.maximum(accel, 0.0), accel)
    accel = np.minimum(np.maximum(accel, -_MAX_DECEL_MPS2), _MAX_ACCEL_MPS2)
    stop = _stop_places(view)
    along = _along(view, speed, accel, stop)
    across = _across(view, offset, slide, push)
    along_cost, places, speeds = _rate_along(view, along, stop)
    across_cost, offsets = _rate_across(view, across, speed)
    total = along_cost[:, :, None] + across_cost[:, None, :]
    total += _collisions(view, places, speeds, offsets)
    best = total.reshape(len(total), -1).argmin(axis=1)
    rows = np.arange(len(total))
    first, second = np.divmod(best, total.shape[2])
    return (
        Motions(along.coefficients[:, rows, first], along.end_s[rows, first]),
        Motions(across.coefficients[:, rows, second], across.end_s[rows, second]),
    )


def _stop_places(view: PlannerView) -> Array:
    """Return (S,) where base_link has to stand for a light or for others, infinite for nothing."""
    stop = wait_arcs(view)
    if view.stop_arc_m is not None:
        stop = np.minimum(stop, view.stop_arc_m)
    stop = stop - front_from_base_m(view.vehicle)
    # Who cannot stop any more goes on.
    way = np.maximum(stop - view.arc_m, 0.1)
    needs = np.square(np.maximum(view.states[:, 3], 0.0)) / (2.0 * way)
    return np.where(needs < 4.0, stop, np.inf)


def _along(view: PlannerView, speed: Array, accel: Floats, stop: Array) -> Motions:
    """Return (S, L) motions along the path."""
    arc, speed, accel = view.arc_m[:, None], speed[:, None], accel[:, None]
    profile = view.path.speed_profile(
        lateral_accel_mps2=_LATERAL_ACCEL_MPS2, decel_mps2=_COMFORT_DECEL_MPS2
    )
    bend = view.path.at_nodes(profile, arc + speed * _SPEED_TIMES_S)
    wanted = np.minimum(view.target_speed_mps[:, None], view.speed_factor[:, None] * bend)
    ends = (wanted[:, :, None] * _SPEED_SHARES).reshape(len(arc), -1)
    times = np.repeat(_SPEED_TIMES_S, len(_SPEED_SHARES))
    keeping = to_speed(arc, speed, accel, end_speed=ends, end_s=times)

    brake_s = np.maximum(speed / np.array([_MAX_DECEL_MPS2 - 1.0, 3.5]) * 1.3, 0.5)
    braking = to_speed(arc, speed, accel, end_speed=np.zeros_like(brake_s), end_s=brake_s)

    way = np.minimum(np.maximum(stop[:, None] - _LINE_GAP_M - arc, 0.0), 150.0)
    stop_s = np.clip(2.0 * way / np.maximum(speed, 2.0), 1.0, 12.0) * np.array([1.0, 1.4])
    stopping = to_place(
        arc, speed, accel, end_place=arc + way, end_speed=np.zeros_like(stop_s), end_s=stop_s
    )

    lead = np.maximum(view.lead_speed_mps, 0.0)[:, None]
    gap = np.minimum(view.lead_gap_m, 150.0)[:, None]
    room = gap + lead * _SPEED_TIMES_S - _STANDSTILL_GAP_M - _TIME_GAP_S * lead
    following = to_place(
        arc, speed, accel, end_place=arc + np.maximum(room, 0.0),
        end_speed=np.broadcast_to(lead, room.shape), end_s=_SPEED_TIMES_S,
    )  # fmt: skip
    return joined(keeping, braking, stopping, following)


def _across(view: PlannerView, offset: Floats, slide: Floats, push: Floats) -> Motions:
    """Return (S, D) motions across the path: to offsets beside the wanted one, and to stay."""
    offset, slide, push = offset[:, None], slide[:, None], push[:, None]
    aside = np.repeat(_ASIDE_M, len(_ASIDE_TIMES_S))
    times = np.tile(_ASIDE_TIMES_S, len(_ASIDE_M))
    ends = np.concatenate([view.desired_offset_m[:, None] + aside, offset], axis=1)
    return to_place(
        offset, slide, push, end_place=ends, end_speed=np.zeros_like(ends),
        end_s=np.append(times, 2.0),
    )  # fmt: skip


def _rough(motions: Motions, origin: Array) -> Motions:
    """Return motions in single precision, places counted from where each car is."""
    coefficients = motions.coefficients.copy()
    coefficients[0] -= origin[:, None]
    return Motions(coefficients.astype(np.float32), motions.end_s.astype(np.float32))


def _rate_along(view: PlannerView, along: Motions, stop: Array) -> tuple[Floats, Floats, Floats]:
    """Return costs (S, L), and places, from the present one on, and speeds (K, S, L)."""
    rough = _rough(along, view.arc_m)
    place, speed, accel = rough.at(_ROUGH_INSTANTS_S)
    jerk = rough.jerk_at(_ROUGH_INSTANTS_S)
    target = np.maximum(view.target_speed_mps, 0.0).astype(np.float32)[:, None]
    cost = (
        _WEIGHT_SPEED * np.square(speed - target)
        + _WEIGHT_ACCEL * np.square(accel)
        + _WEIGHT_JERK * np.square(np.minimum(np.abs(jerk), np.float32(20.0)))
    ).sum(axis=0) / _INSTANTS
    most = _MAX_ACCEL_MPS2 * np.clip(view.speed_factor, 0.3, 2.0)[:, None]
    wrong = (accel.max(axis=0) > most) | (accel.min(axis=0) < -_MAX_DECEL_MPS2 - 1.0)
    wrong |= speed.min(axis=0) < -0.1
    bends = np.abs(view.path.curvature_pm).astype(np.float32)
    here = ((view.arc_m - view.path.arc_m[0]) / SPACING_M + 0.5).astype(np.float32)
    nodes = (place / SPACING_M + here[:, None]).astype(np.intp)
    lateral = (np.square(speed) * bends.take(nodes, mode="clip")).max(axis=0)
    allowed = np.square(np.maximum(view.speed_factor, 1.0))[:, None]
    excess = np.maximum(lateral / (allowed * _LATERAL_ACCEL_MPS2) - 1.0, 0.0)
    wrong |= lateral > _MAX_LATERAL_MPS2 * allowed
    beyond = place.max(axis=0) - (stop - view.arc_m)[:, None]
    cost = cost + 20.0 * excess + _FORBIDDEN * wrong
    cost += np.where(beyond > 0.0, _CROSSES_LINE + beyond, 0.0)
    return cost, place, speed


def _rate_across(view: PlannerView, across: Motions, speed: Array) -> tuple[Floats, Floats]:
    """Return costs (S, D) and offsets (K, S, D)."""
    rough = _rough(across, np.zeros(len(speed)))
    offset, slide, _ = rough.at(_ROUGH_INSTANTS_S)
    jerk = rough.jerk_at(_ROUGH_INSTANTS_S)
    wanted = view.desired_offset_m.astype(np.float32)[:, None]
    cost = _WEIGHT_ASIDE * np.square(offset - wanted) + _WEIGHT_ACROSS_JERK * np.square(jerk)
    cost = cost.sum(axis=0) / _INSTANTS
    steep = np.abs(slide).max(axis=0) > (_SLOPE * speed + 0.1)[:, None]
    # To stay is always possible.
    steep[:, -1] = False
    return cost + _FORBIDDEN * steep, offset


def _collisions(view: PlannerView, place: Floats, speed: Floats, offset: Floats) -> Floats:
    """Return (S, L, D) what touching others costs: more the longer it lasts.

    Boxes along the path; between two instants each may be half a step farther. Whether two overlap
    is a product of overlaps along and across, summed over others and instants.
    """
    found = courses(view, _INSTANTS_S, nearest=_NEAREST)
    if found is None:
        return np.zeros((place.shape[1], 1, 1))
    vehicle = view.vehicle
    half_step = np.float32(HORIZON_S / _INSTANTS / 2.0)
    ahead = found.arc_m - (view.arc_m + box_centre_from_base_m(vehicle))[:, None]
    reach = 0.5 * vehicle.length_m.value + _ALONG_MARGIN_M + found.half_along_m
    closing = np.abs(speed[:, :, None] - _single(found.along_mps))
    along = np.abs(place[:, :, None] - _single(ahead)) < _single(reach) + half_step * closing
    width = 0.5 * vehicle.width_m.value + _ACROSS_MARGIN_M + found.half_across_m
    width = width + half_step * np.abs(found.across_mps)
    across = np.abs(offset[:, :, None] - _single(found.offset_m)) < _single(width)
    count = place.shape[1]
    instants = along.shape[0] * along.shape[2]
    first = along.transpose(1, 3, 0, 2).reshape(count, -1, instants).astype(np.float32)
    second = across.transpose(1, 0, 2, 3).reshape(count, instants, -1).astype(np.float32)
    # Sums of ones: exact, in whatever order.
    touched = first @ second
    return np.where(touched > 0.5, _COLLIDES + 10.0 * touched, 0.0)


def _single(values: Array) -> Floats:
    """Return (…, 1) in single precision, for an axis of candidates."""
    return np.asarray(values.astype(np.float32)[..., None])
