"""Displacement of predictions from what happened, and how many futures really differ.

How far two courses lie apart whatever the time: discrete Fréchet distance and time warping.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from foretwin.contracts.arrays import Array, Flags
from foretwin.contracts.frames import wrap_angle
from foretwin.contracts.simulation import HorizonError
from foretwin.geometry import compiled
from foretwin.sim_worker.metrics.rollout import Measure, RolloutView

_Summary = Callable[["Displacements"], Array]
_SEED_S = 1e-6
"""The seeding instant is left out: there every prediction is right."""


class Displacements(NamedTuple):
    """S predictions against one reference at N instants; signed values in the reference's axes.

    `distance_m`, `lateral_m` (positive: the prediction lies to the left), `longitudinal_m` and
    `heading_rad` are (S, N).
    """

    distance_m: Array
    lateral_m: Array
    longitudinal_m: Array
    heading_rad: Array


def displacements(predicted: Array, reference: Array) -> Displacements:
    """Compare poses (S, N, 3) with poses (N, 3) or (S, N, 3) at the same instants of one frame."""
    dx = predicted[..., 0] - reference[..., 0]
    dy = predicted[..., 1] - reference[..., 1]
    cos, sin = np.cos(reference[..., 2]), np.sin(reference[..., 2])
    return Displacements(
        distance_m=np.hypot(dx, dy),
        lateral_m=cos * dy - sin * dx,
        longitudinal_m=cos * dx + sin * dy,
        heading_rad=wrap_angle(predicted[..., 2] - reference[..., 2]),
    )


def relative_pose_error(predicted: Array, reference: Array) -> Array:
    """Return (S,) root mean square errors in metres of the way from each instant to the next.

    Translational part of the relative pose error with Δ = 1: Sturm et al. (2012), equation 2.
    """
    difference = _steps_in_own_axes(predicted) - _steps_in_own_axes(reference)
    return np.asarray(np.sqrt(np.square(difference).sum(axis=-1).mean(axis=-1)))


def horizon_error(predicted: Array, actual: Array) -> HorizonError:
    """Compare (N, 3) x, y, yaw at the same N instants of one frame, the seeding one left out.

    ADE is the mean, FDE the final distance; lateral, longitudinal and heading are those of the
    last instant, signed, in the actual pose's axes. Raises ValueError for empty or unequal input.
    """
    if predicted.shape != actual.shape or predicted.ndim != 2 or predicted.shape[1] != 3:
        raise ValueError(f"poses of shape {predicted.shape} against {actual.shape}: need (N, 3)")
    if len(predicted) == 0:
        raise ValueError("no instant to compare")
    found = displacements(predicted, actual)
    return HorizonError(
        ade_m=float(found.distance_m.mean()),
        fde_m=float(found.distance_m[-1]),
        lateral_m=float(found.lateral_m[-1]),
        longitudinal_m=float(found.longitudinal_m[-1]),
        heading_rad=float(found.heading_rad[-1]),
    )


def distinct_count(ends: Array, least_m: float = 0.1) -> int:
    """Return how many of the (S, 2) end points lie more than `least_m` from all counted before."""
    known = np.asarray(ends, dtype=np.float64)[np.isfinite(ends).all(axis=1)]
    counts = np.ones(len(known), dtype=bool)
    for row, apart in enumerate(np.hypot(*(known[:, None] - known).T) > least_m):
        if counts[row]:
            counts[row + 1 :] &= apart[row + 1 :]
    return int(np.count_nonzero(counts))


def known(view: RolloutView) -> tuple[Array, Array]:
    """Return the futures' poses (S, K, 3) and the reference (K, 3) where that is known."""
    reference = view.context.reference
    if reference is None:
        raise ValueError("no reference to compare with")
    if reference.shape != (len(view.time_s), 3):
        raise ValueError(f"reference: {reference.shape}, expected ({len(view.time_s)}, 3)")
    there: Flags = np.asarray(np.isfinite(reference).all(axis=1))
    return view.states[:, there, :3], np.asarray(reference[there], dtype=np.float64)


def ade(view: RolloutView) -> Measure:
    """Average displacement error (S,): Pellegrini et al. (2009), You'll Never Walk Alone."""
    return _of(view, lambda found: found.distance_m.mean(axis=1))


def fde(view: RolloutView) -> Measure:
    """Final displacement error (S,), at the last known instant: Alahi et al. (2016), Social LSTM.

    Where the reference ends before the rollout, that is not the rollout's last.
    """
    return _of(view, lambda found: found.distance_m[:, -1])


def lateral(view: RolloutView) -> Measure:
    """How far to the left of the reference (S,) the future ends, negative to the right."""
    return _of(view, lambda found: found.lateral_m[:, -1])


def longitudinal(view: RolloutView) -> Measure:
    """How far ahead of the reference (S,) the future ends, negative behind."""
    return _of(view, lambda found: found.longitudinal_m[:, -1])


def heading(view: RolloutView) -> Measure:
    """How far the future's yaw is turned (S,) from the reference's at the end."""
    return _of(view, lambda found: found.heading_rad[:, -1])


def ape(view: RolloutView) -> Measure:
    """Absolute pose error (S,) over all known instants but the seeding one, without alignment.

    Absolute trajectory error: Sturm et al. (2012), A Benchmark for the Evaluation of RGB-D SLAM
    Systems, equation 3, with the identity for S. What evo calls the APE's translation part.
    """
    return _of(view, lambda found: np.sqrt(np.square(found.distance_m).mean(axis=1)))


def rpe(view: RolloutView) -> Measure:
    """Relative pose error (S,) from each known instant to the next."""
    predicted, reference = known(view)
    if len(reference) < 2:
        return nowhere(view)
    return view.measure(relative_pose_error(predicted, reference))


def nowhere(view: RolloutView) -> Measure:
    """Return a measure (S,) that is valid for no future."""
    return view.measure(np.full(len(view.valid), np.nan), np.zeros(len(view.valid), dtype=bool))


def _of(view: RolloutView, summary: _Summary) -> Measure:
    found = view.keep(_after_seed)
    return nowhere(view) if found is None else view.measure(np.asarray(summary(found)))


def _after_seed(view: RolloutView) -> Displacements | None:
    predicted, reference = known(view)
    time_s = view.time_s[np.isfinite(view.context.reference).all(axis=1)]  # type: ignore[arg-type]
    later = time_s > _SEED_S
    if not later.any():
        return None
    return displacements(predicted[:, later], reference[later])


def _steps_in_own_axes(poses: Array) -> Array:
    step = np.diff(poses[..., :2], axis=-2)
    cos, sin = np.cos(poses[..., :-1, 2]), np.sin(poses[..., :-1, 2])
    return np.stack(
        [cos * step[..., 0] + sin * step[..., 1], cos * step[..., 1] - sin * step[..., 0]], axis=-1
    )


def cheapest_walks(curves: Array, reference: Array) -> Array:
    """Return (2, S) metres: of curves (S, N, 2) from one (M, 2), the discrete Fréchet distances
    (Eiter and Mannila 1994, Computing Discrete Fréchet Distance, table 1) and the least sums.

    Both are of the walks along the pairs of points that never go back and have the least of it.
    The sums are dynamic time warping: Sakoe and Chiba (1978), Dynamic Programming Algorithm
    Optimization for Spoken Word Recognition, equation 11, weight 1 for every pair and no window.
    """
    x, y = (np.ascontiguousarray(curves[..., k], dtype=np.float64) for k in range(2))
    to_x, to_y = (np.ascontiguousarray(reference[:, k], dtype=np.float64) for k in range(2))
    found = np.empty((2, len(x)))
    compiled.cheapest_walks(x, y, to_x, to_y, found)
    return found


def frechet(view: RolloutView) -> Measure:
    """Discrete Fréchet distance (S,) from the reference's course."""
    found = view.keep(_from_reference)
    return view.measure(found[0]) if found is not None else nowhere(view)


def dtw(view: RolloutView) -> Measure:
    """Time warping distance (S,) from the reference's course, a sum over pairs of points."""
    found = view.keep(_from_reference)
    return view.measure(found[1]) if found is not None else nowhere(view)


def _from_reference(view: RolloutView) -> Array | None:
    predicted, reference = known(view)
    if not len(reference):
        return None
    return cheapest_walks(predicted[..., :2], reference[:, :2])
