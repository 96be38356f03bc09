"""A round for those who watch: the fan of futures, and whom the worst of them meet."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from foretwin.contracts.arrays import Array, Array32
from foretwin.contracts.frames import LocalFrame, target_from_source
from foretwin.contracts.futures import COLLISION_WITH
from foretwin.contracts.simulation import RoundView
from foretwin.contracts.trace import traced
from foretwin.contracts.world import World
from foretwin.orchestrator.record.result_rows import RoundFutures
from foretwin.orchestrator.rounds.future_titles import future_title
from foretwin.orchestrator.runner.open_rounds import RoundDone

VIEW_POINTS = 25
_SHOWN = 16
"""Of so many futures, the worst first, one sees the road user that they hit or nearly hit."""
_ROAD_USER = COLLISION_WITH.index("road_user")


@traced("view of a round")
def round_view(
    done: RoundDone,
    futures: RoundFutures,
    world_frame: LocalFrame,
    drive_frame: LocalFrame,
    place: str = "",
) -> RoundView:
    """Return a round for those who watch: fewer points, in the drive's frame, with criticality.

    `place` is the junction's name.
    """
    count, instants = futures.states.shape[:2]
    kept = np.unique(np.linspace(0, instants - 1, VIEW_POINTS).round().astype(int))

    def in_drive(xy_m: Array) -> Array32:
        flat = np.asarray(xy_m, dtype=np.float64).reshape(-1, 2)
        moved = target_from_source(drive_frame, world_frame, flat, np.zeros(len(flat))).xy_m
        return moved.reshape(xy_m.shape).astype(np.float32)

    clearance = np.where(np.isfinite(futures.min_clearance_m), futures.min_clearance_m, np.inf)
    criticality = futures.criticality
    nearest = float(clearance.min()) if count else np.inf
    met = _met(done, criticality, kept)
    return RoundView(
        round_id=done.order.round_id,
        stamp_ns=done.order.stamp_ns,
        intersection_id=done.order.junction_id,
        place=place,
        world_id=done.order.world_id,
        xy_m=in_drive(futures.states[:, kept, :2]),
        criticality=criticality.astype(np.float32),
        likelihood=futures.likelihood.astype(np.float32),
        nominal_index=0,
        names=_names(done),
        collided=int(np.count_nonzero(futures.collided)),
        min_clearance_m=nearest if np.isfinite(nearest) else None,
        latency_ms=done.latency_ms,
        user_xy_m=in_drive(met.tracks_m),
        touch_xy_m=in_drive(met.touches_m),
        touch_names=met.touch_names,
        late=done.late,
    )


def place_of(done: RoundDone, world: World) -> str:
    """Return the streets that meet at a round's junction; empty where its World names none."""
    wanted = done.order.junction_id
    return next((j.summary.name for j in world.junctions if j.summary.id == wanted), "")


def _names(done: RoundDone) -> tuple[str, ...]:
    """Return what happens in each future; one whose scenario is left out says so."""
    titles = {scenario.id: scenario.title for job in done.order.jobs for scenario in job.scenarios}
    left_out = [reason for result in done.results for reason in result.left_out]
    return tuple(
        future_title(future, titles) + (" (left out)" if reason else "")
        for future, reason in zip(done.order.futures, left_out, strict=True)
    )


class _Met(NamedTuple):
    """In the World's frame: tracks (K, M, 2), places of touches (C, 2) and what happened there."""

    tracks_m: Array
    touches_m: Array
    touch_names: tuple[str, ...]


def _met(done: RoundDone, criticality: Array, kept: np.ndarray[Any, Any]) -> _Met:
    """Return the nearest road user of each of the worst futures, and where cars touch theirs."""
    tracks, touches, names = [], [], []
    worst = {int(i) for i in np.argsort(-criticality, kind="stable")[:_SHOWN]}
    number = 0
    for result in done.results:
        poses, states = result.road_users.poses, result.trajectory.states
        for place in range(len(result.future_indices)):
            shown = number in worst and criticality[number] > 0.0
            future = done.order.futures[number]
            number += 1
            there = np.flatnonzero(np.isfinite(poses[place, 0, :, 0]))
            if not len(there):
                continue
            away = poses[place][:, there, :2] - states[place, :, None, :2]
            nearest = there[np.hypot(away[..., 0], away[..., 1]).min(axis=0).argmin()]
            if shown:
                tracks.append(poses[place, kept, nearest, :2])
            if result.outcome.collision_with[place] == _ROAD_USER:
                time_s = float(result.outcome.collision_time_s[place])
                instant = int(np.searchsorted(result.trajectory.time_s, time_s))
                touches.append(poses[place, min(instant, poses.shape[1] - 1), nearest, :2])
                names.append(future.scenario_id)
    found = np.array(tracks, dtype=np.float64).reshape(-1, len(kept), 2)
    return _Met(found, np.array(touches, dtype=np.float64).reshape(-1, 2), tuple(names))
