"""What the lattice planner's candidates cost: all cars and all candidates at once.

In single precision, with instants on the first axis, so that sums over them are of whole rows.
"""

from __future__ import annotations

import numpy as np

from foretwin.contracts.arrays import Array, Flags
from foretwin.geometry.frenet_path import SPACING_M
from foretwin.sim_worker.driver_model import HASTE, LATERAL_ACCEL_MPS2, MAX_DECEL_MPS2
from foretwin.sim_worker.planner_interface import PlannerView
from foretwin.sim_worker.planners.polynomials import Floats, Motions
from foretwin.sim_worker.planners.prediction import Changes, courses
from foretwin.sim_worker.vehicle.reference_points import box_centre_from_base_m

HORIZON_S, _INSTANTS = 4.0, 12
_INSTANTS_S: Array = np.linspace(HORIZON_S / _INSTANTS, HORIZON_S, _INSTANTS)
_ROUGH_INSTANTS_S = _INSTANTS_S.astype(np.float32)[:, None, None]
_NEAREST, _BITS = 6, 4
"""So few others are looked at that their number, twice if all turn, fits into so many bits."""
_DIGITS = np.exp2(_BITS * np.arange(_INSTANTS - 1, -1, -1.0))[:, None, None, None]
CANDIDATE_ACCEL_MPS2, _MAX_LATERAL_MPS2 = 2.5, 4.0
"""Candidates with more are not driven. Chosen: jerk and comfort, which cost, keep them lower."""
_ALONG_MARGIN_M, _ACROSS_MARGIN_M = 0.8, 0.4
_SLOPE = 0.3
"""Of the own speed, how fast a car may move across its path."""
_WEIGHT_SPEED, _WEIGHT_ACCEL, _WEIGHT_JERK = 0.15, 0.25, 0.05
_WEIGHT_ASIDE, _WEIGHT_ACROSS_JERK = 0.6, 0.1
_FORBIDDEN, _CROSSES_LINE = 1e4, 300.0
_COLLIDES, _SOONER, _HARDER = 100.0, 5.0, 4.0
"""At all, by each instant sooner, by each m²/s² of the own speed: far more than comfort counts."""


def rate_along(view: PlannerView, along: Motions, stop: Array) -> tuple[Floats, Floats, Floats]:
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
    most = CANDIDATE_ACCEL_MPS2 * np.clip(view.speed_factor, *HASTE)[:, None]
    wrong = (accel.max(axis=0) > most) | (accel.min(axis=0) < -MAX_DECEL_MPS2 - 0.5)
    wrong |= speed.min(axis=0) < -0.1
    bends = np.abs(view.path.curvature_pm).astype(np.float32)
    here = ((view.arc_m - view.path.arc_m[0]) / SPACING_M + 0.5).astype(np.float32)
    nodes = (place / SPACING_M + here[:, None]).astype(np.intp)
    lateral = (np.square(speed) * bends.take(nodes, mode="clip")).max(axis=0)
    allowed = np.square(np.maximum(view.speed_factor, 1.0))[:, None]
    excess = np.maximum(lateral / (allowed * LATERAL_ACCEL_MPS2) - 1.0, 0.0)
    wrong |= lateral > _MAX_LATERAL_MPS2 * allowed
    beyond = place.max(axis=0) - (stop - view.arc_m)[:, None]
    cost = cost + 20.0 * excess + _FORBIDDEN * wrong
    cost += np.where(beyond > 0.0, _CROSSES_LINE + beyond, 0.0)
    return cost, place, speed


def rate_across(view: PlannerView, across: Motions, speed: Array) -> tuple[Floats, Floats]:
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


def still_free(
    view: PlannerView, along: Motions, across: Motions, now_s: Array, changing: Changes | None
) -> Flags:
    """Return (S,) whether motions that began `now_s` (S,) ago go on to touch nobody."""
    later = now_s + _INSTANTS_S[:, None]
    place, speed, _ = along.at(later)
    place = place - view.arc_m
    offset = across.place_at(later)
    cost = collisions(view, place[..., None], speed[..., None], offset[..., None], changing)
    return np.broadcast_to(cost[:, 0, 0] == 0.0, now_s.shape)


def collisions(
    view: PlannerView, place: Floats, speed: Floats, offset: Floats, changing: Changes | None
) -> Floats:
    """Return (S, L, D) what touching others costs: more the sooner, and the faster one still is.

    What would follow on the first touch counts for nothing. Boxes along the path; between two
    instants each may be half a step farther. Whether two overlap is a product of overlaps along
    and across, summed over others and instants: of digits to a base that no instant's sum reaches,
    so that the highest one tells the first instant.
    """
    found = courses(view, _INSTANTS_S, nearest=_NEAREST, changing=changing)
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
    count, instants = place.shape[1], along.shape[0] * along.shape[2]
    weighted = along * _DIGITS
    overlaps = weighted.transpose(1, 3, 0, 2).reshape(count, -1, instants)
    beside = across.transpose(1, 0, 2, 3).reshape(count, instants, -1).astype(np.float64)
    # Sums of whole numbers below 2**53: exact, in whatever order.
    digits = overlaps @ beside
    first = _INSTANTS - 1 - (np.frexp(digits)[1] - 1) // _BITS
    hit = digits > 0.5
    then = np.take_along_axis(np.square(speed).transpose(1, 2, 0), np.where(hit, first, 0), axis=2)
    return np.where(hit, _COLLIDES + _SOONER * (_INSTANTS - first) + _HARDER * then, 0.0)


def _single(values: Array) -> Floats:
    """Return (…, 1) in single precision, for an axis of candidates."""
    return np.asarray(values.astype(np.float32)[..., None])


def _rough(motions: Motions, origin: Array) -> Motions:
    """Return motions in single precision, places counted from where each car is."""
    coefficients = motions.coefficients.copy()
    coefficients[0] -= origin[:, None]
    return Motions(coefficients.astype(np.float32), motions.end_s.astype(np.float32))
