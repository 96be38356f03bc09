"""A round for those who watch: the fan of futures, and whom the worst of them meet."""

from __future__ import annotations

from typing import Any, NamedTuple, cast

import numpy as np

from foretwin.contracts.arrays import Array, Array32
from foretwin.contracts.drive import RoadUserKind
from foretwin.contracts.frames import LocalFrame, target_from_source_m
from foretwin.contracts.futures import COLLISION_WITH, RoadUserTracks
from foretwin.contracts.simulation import FutureHit, MetRoadUser, RoundView
from foretwin.contracts.trace import traced
from foretwin.contracts.world import World
from foretwin.orchestrator.record.result_rows import RoundFutures
from foretwin.orchestrator.rounds.future_titles import future_title
from foretwin.orchestrator.runner.open_rounds import RoundDone

VIEW_POINTS = 25
_SHOWN = 16
"""Of so many futures, the worst first, one sees the road user that they hit or nearly hit."""
_ROAD_USER, _STATIC = COLLISION_WITH.index("road_user"), COLLISION_WITH.index("static")


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
        moved = target_from_source_m(drive_frame, world_frame, flat)
        return moved.reshape(xy_m.shape).astype(np.float32)

    clearance = np.where(np.isfinite(futures.min_clearance_m), futures.min_clearance_m, np.inf)
    criticality = futures.criticality
    nearest = float(clearance.min()) if count else np.inf
    # How grave is not known counts as grave, as in the viewer's colours.
    met = _met(done, np.nan_to_num(criticality, nan=1.0), kept)
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
        horizon_s=float(done.results[0].trajectory.time_s[-1]),
        hits=met.hits,
        met=met.road_users,
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
    """In the World's frame: tracks (K, M, 2) of road users, places of touches (C, 2) and what
    happened there; all collisions."""

    tracks_m: Array
    touches_m: Array
    touch_names: tuple[str, ...]
    road_users: tuple[MetRoadUser, ...]
    hits: tuple[FutureHit, ...]


def _met(done: RoundDone, criticality: Array, kept: np.ndarray[Any, Any]) -> _Met:
    """Return the nearest road user of each of the worst futures, and where cars touch theirs."""
    tracks, touches, names = [], [], []
    road_users: list[MetRoadUser] = []
    hits: list[FutureHit] = []
    worst = {int(i) for i in np.argsort(-criticality, kind="stable")[:_SHOWN]}
    number = -1
    for result in done.results:
        poses, states = result.road_users.poses, result.trajectory.states
        times_s, outcome = result.trajectory.time_s, result.outcome
        for place in range(len(result.future_indices)):
            number += 1
            shown = number in worst and criticality[number] > 0.0
            future = done.order.futures[number]
            hit_s = float(outcome.collision_time_s[place]) if outcome.collided[place] else None
            if hit_s is not None and outcome.collision_with[place] == _STATIC:
                hits.append(FutureHit(future=number, time_s=hit_s, what="static"))
            there = np.flatnonzero(np.isfinite(poses[place, 0, :, 0]))
            if not len(there):
                continue
            away = poses[place][:, there, :2] - states[place, :, None, :2]
            far_m = np.hypot(away[..., 0], away[..., 1])
            who = int(far_m.min(axis=0).argmin())
            nearest = int(there[who])
            kind = _kind(result.road_users, place, nearest)
            if shown:
                tracks.append(poses[place, kept, nearest, :2])
                nearest_s = float(times_s[int(far_m[:, who].argmin())])
                road_users.append(
                    MetRoadUser(
                        future=number,
                        time_s=nearest_s if hit_s is None else hit_s,
                        kind=kind,
                        scenario_id=future.scenario_id,
                    )
                )
            if hit_s is not None and outcome.collision_with[place] == _ROAD_USER:
                hits.append(FutureHit(future=number, time_s=hit_s, what=kind))
                instant = int(np.searchsorted(times_s, hit_s))
                touches.append(poses[place, min(instant, poses.shape[1] - 1), nearest, :2])
                names.append(future.scenario_id)
    found = np.array(tracks, dtype=np.float64).reshape(-1, len(kept), 2)
    touched = np.array(touches, dtype=np.float64).reshape(-1, 2)
    return _Met(found, touched, tuple(names), tuple(road_users), tuple(hits))


def _kind(users: RoadUserTracks, place: int, number: int) -> RoadUserKind:
    return cast(RoadUserKind, users.kind_names[int(users.kinds[place, number])])
