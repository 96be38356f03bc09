"""Futures against what the car did, and against what the car itself had planned.

What a future must beat to be worth its cost are predictions that need no simulation.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from foretwin.contracts.arrays import Array, Stamps
from foretwin.contracts.drive import PlannedTrajectory
from foretwin.contracts.frames import LocalFrame, local_from_geo, local_from_geo_yaw
from foretwin.contracts.futures import PathAhead, Trajectory
from foretwin.contracts.simulation import HORIZONS_S, Comparison, PlanComparison
from foretwin.geometry.constant_turn import constant_turn_rate
from foretwin.geometry.frenet_path import FrenetPath
from foretwin.sim_worker.metrics.displacement import horizon_error

MAX_GAP_S = 1.5
"""Across a longer hole in the track nothing is interpolated: no truth is known there."""
_MIN_PLAN_S = 0.5
"""A plan that overlaps the future by less than this is not compared."""


class NominalTrack(NamedTuple):
    """A nominal future: `xy_yaw` (N, 3) at `time_s` (N,) after `stamp_ns`, 0 included.

    `speed_mps` and `yaw_rate_radps` are those of the seeding state, for the baselines. `mean_xy`
    (N, 2) is where its round's futures are in the mean, by their likelihood.
    """

    stamp_ns: int
    time_s: Array
    xy_yaw: Array
    speed_mps: float
    yaw_rate_radps: float
    mean_xy: Array | None = None


class ActualTrack(NamedTuple):
    """What the car did: `stamps_ns` (M,) rising, `xy_yaw` (M, 3) in the nominal's frame."""

    stamps_ns: Stamps
    xy_yaw: Array


def compare_nominal(
    nominal: NominalTrack,
    actual: ActualTrack,
    *,
    horizons_s: Sequence[float] = HORIZONS_S,
    round_id: int,
    intersection_id: str,
) -> list[Comparison]:
    """Return one Comparison for each horizon that both tracks cover without a hole."""
    comparisons = []
    for horizon in horizons_s:
        if nominal.time_s[-1] < horizon - 1e-6:
            continue
        chosen = (nominal.time_s > 1e-6) & (nominal.time_s <= horizon + 1e-6)
        time_s = nominal.time_s[chosen]
        truth = _poses_at(actual, nominal.stamp_ns, time_s)
        if truth is None:
            continue
        start, speed = nominal.xy_yaw[0], nominal.speed_mps
        turn = constant_turn_rate(
            start, speed_mps=speed, yaw_rate_radps=nominal.yaw_rate_radps, time_s=time_s
        )
        straight = constant_velocity(start, speed_mps=speed, time_s=time_s)
        weighted = None
        if nominal.mean_xy is not None:
            apart = nominal.mean_xy[chosen] - truth[:, :2]
            weighted = float(np.hypot(*apart.T).mean())
        comparisons.append(
            Comparison(
                round_id=round_id,
                stamp_ns=nominal.stamp_ns,
                intersection_id=intersection_id,
                horizon_s=float(horizon),
                nominal=horizon_error(nominal.xy_yaw[chosen], truth),
                constant_velocity=horizon_error(straight, truth),
                constant_turn_rate=horizon_error(turn, truth),
                weighted_ade_m=weighted,
            )
        )
    return comparisons


def compare_plan(
    plan: PlannedTrajectory,
    trajectory: Trajectory,
    path: PathAhead,
    *,
    world_frame: LocalFrame,
    round_id: int,
) -> PlanComparison | None:
    """Compare the car's plan with the first simulation of `trajectory` at the same instants.

    None where the two have less than half a second in common.
    """
    reference = planned_reference(
        plan, stamp_ns=trajectory.stamp_ns, time_s=trajectory.time_s, world_frame=world_frame
    )
    common = np.isfinite(reference[:, 0]) & (trajectory.time_s > 1e-6)
    if not common.any() or np.ptp(trajectory.time_s[common]) < _MIN_PLAN_S:
        return None
    planned = reference[common]
    nominal = np.asarray(trajectory.states[0, common, :3], dtype=np.float64)
    offsets = FrenetPath(path.xy_m).locate(planned[:, :2]).offset_m
    return PlanComparison(
        round_id=round_id,
        stamp_ns=trajectory.stamp_ns,
        plan_stamp_ns=plan.stamp_ns,
        horizon_s=float(trajectory.time_s[common][-1]),
        difference=horizon_error(planned, nominal),
        path_offset_m=float(offsets.mean()),
    )


def planned_reference(
    plan: PlannedTrajectory, *, stamp_ns: int, time_s: Array, world_frame: LocalFrame
) -> Array:
    """Return poses (N, 3) of a plan in `world_frame` at `time_s` (N,) after `stamp_ns`.

    They are NaN before the plan begins and after it ends.
    """
    xy = local_from_geo(world_frame, plan.lat_deg, plan.lon_deg)
    yaw = local_from_geo_yaw(world_frame, plan.yaw_rad, plan.lat_deg, plan.lon_deg)
    at_s = time_s + (stamp_ns - plan.stamp_ns) / 1e9
    begin, end = plan.time_from_stamp_s[0], plan.time_from_stamp_s[-1]
    poses = _interpolated(at_s, plan.time_from_stamp_s, np.column_stack([xy, yaw]))
    poses[(at_s < begin - 1e-6) | (at_s > end + 1e-6)] = np.nan
    return poses


def _poses_at(actual: ActualTrack, stamp_ns: int, time_s: Array) -> Array | None:
    """Return (N, 3) interpolated poses, None where the track does not reach or has a hole."""
    if len(actual.stamps_ns) < 2:
        return None
    known_s = (actual.stamps_ns - stamp_ns) / 1e9
    if known_s[0] > time_s[0] or known_s[-1] < time_s[-1] - 1e-6:
        return None
    first = max(int(np.searchsorted(known_s, time_s[0], side="right")) - 1, 0)
    last = int(np.searchsorted(known_s, time_s[-1] - 1e-6))
    if (np.diff(known_s[first : last + 1]) > MAX_GAP_S).any():
        return None
    return _interpolated(time_s, known_s, actual.xy_yaw)


def _interpolated(at_s: Array, known_s: Array, poses: Array) -> Array:
    yaw = np.unwrap(poses[:, 2])
    columns = (poses[:, 0], poses[:, 1], yaw)
    return np.stack([np.interp(at_s, known_s, column) for column in columns], axis=1)


def constant_velocity(pose: Array, *, speed_mps: float, time_s: Array) -> Array:
    """Return (N, 3) poses at `time_s` (N,) of a car that goes straight on from `pose` (3,)."""
    return constant_turn_rate(pose, speed_mps=speed_mps, yaw_rate_radps=0.0, time_s=time_s)
