"""A round for those who watch: the fan of futures, and whom the worst of them meet."""

from __future__ import annotations

from typing import Any, NamedTuple, cast

import numpy as np

from foretwin.contracts.arrays import Array, Array32
from foretwin.contracts.drive import RoadUserKind
from foretwin.contracts.frames import LocalFrame, target_from_source_m
from foretwin.contracts.futures import COLLISION_WITH, FuturesResult, RoadUserTracks
from foretwin.contracts.simulation import FutureHit, MetRoadUser, RoundView
from foretwin.contracts.trace import traced
from foretwin.contracts.vehicle import VehicleParameters
from foretwin.contracts.world import World
from foretwin.geometry.rectangles import Rectangles, clearance
from foretwin.orchestrator.record.result_rows import RoundFutures
from foretwin.orchestrator.rounds.future_titles import future_title
from foretwin.orchestrator.runner.open_rounds import RoundDone
from foretwin.sim_worker.batch.collision_detection import ego_rectangles

VIEW_POINTS = 25
_SHOWN = 16
"""Of so many futures, the worst first, one sees the road user that they hit or nearly hit."""
_ROAD_USER, _STATIC = COLLISION_WITH.index("road_user"), COLLISION_WITH.index("static")


@traced("view of a round")
def round_view(
    done: RoundDone,
    futures: RoundFutures,
    world: World,
    vehicle: VehicleParameters,
    drive_frame: LocalFrame,
) -> RoundView:
    """Return a round for those who watch: fewer points, in the drive's frame, with criticality."""
    count, instants = futures.states.shape[:2]
    kept = np.unique(np.linspace(0, instants - 1, VIEW_POINTS).round().astype(int))

    def in_drive(xy_m: Array) -> Array32:
        flat = np.asarray(xy_m, dtype=np.float64).reshape(-1, 2)
        moved = target_from_source_m(drive_frame, world.frame, flat)
        return moved.reshape(xy_m.shape).astype(np.float32)

    least_m = np.where(np.isfinite(futures.min_clearance_m), futures.min_clearance_m, np.inf)
    criticality = futures.criticality
    nearest = float(least_m.min()) if count else np.inf
    # How grave is not known counts as grave, as in the viewer's colours.
    met = _met(done, np.nan_to_num(criticality, nan=1.0), kept, vehicle)
    return RoundView(
        round_id=done.order.round_id,
        stamp_ns=done.order.stamp_ns,
        intersection_id=done.order.junction_id,
        place=place_of(done, world),
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


def _met(
    done: RoundDone, criticality: Array, kept: np.ndarray[Any, Any], vehicle: VehicleParameters
) -> _Met:
    """Return whom each of the worst futures hits or comes nearest to, and where cars touch."""
    tracks, touches, names = [], [], []
    road_users: list[MetRoadUser] = []
    hits: list[FutureHit] = []
    worst = {int(i) for i in np.argsort(-criticality, kind="stable")[:_SHOWN]}
    number = -1
    for result in done.results:
        poses, outcome = result.road_users.poses, result.outcome
        times_s = result.trajectory.time_s
        for place in range(len(result.future_indices)):
            number += 1
            shown = number in worst and criticality[number] > 0.0
            future = done.order.futures[number]
            hit_s = float(outcome.collision_time_s[place]) if outcome.collided[place] else None
            if hit_s is not None and outcome.collision_with[place] == _STATIC:
                hits.append(FutureHit(future=number, time_s=hit_s, what="static"))
            hits_user = hit_s is not None and outcome.collision_with[place] == _ROAD_USER
            if not (shown or hits_user):
                continue
            one = _whom(result, place, vehicle, hit_s if hits_user else None)
            if one is None:
                continue
            nearest = one.road_user
            kind = _kind(result.road_users, place, nearest)
            if shown and np.isfinite(poses[place, 0, nearest, 0]):
                tracks.append(poses[place, kept, nearest, :2])
                nearest_s = float(times_s[one.instant])
                road_users.append(
                    MetRoadUser(
                        future=number,
                        time_s=nearest_s if hit_s is None else hit_s,
                        kind=kind,
                        scenario_id=future.scenario_id,
                    )
                )
            if hit_s is not None and hits_user:
                hits.append(FutureHit(future=number, time_s=hit_s, what=kind))
                instant = int(np.searchsorted(times_s, hit_s))
                touches.append(poses[place, min(instant, poses.shape[1] - 1), nearest, :2])
                names.append(future.scenario_id)
    found = np.array(tracks, dtype=np.float64).reshape(-1, len(kept), 2)
    touched = np.array(touches, dtype=np.float64).reshape(-1, 2)
    return _Met(found, touched, tuple(names), tuple(road_users), tuple(hits))


class _Whom(NamedTuple):
    """A road user by its number, and the instant at which a future comes nearest to it."""

    road_user: int
    instant: int


def _whom(
    result: FuturesResult, place: int, vehicle: VehicleParameters, hit_s: float | None
) -> _Whom | None:
    """Return whom a future hits at `hit_s`, else whom its outline comes nearest to; None where
    nobody is there from the beginning until then."""
    users, times_s = result.road_users, result.trajectory.time_s
    first, last = 0, len(times_s)
    if hit_s is not None:
        first = min(max(int(np.searchsorted(times_s, hit_s)) - 1, 0), last - 1)
        last = first + 2
        partner = next((one.road_user for one in result.accidents if one.future == place), None)
        if partner is not None:
            return _Whom(partner, first)
    poses = users.poses[place, first:last].astype(np.float64)
    known = np.isfinite(users.poses[place, 0, :, 0]) & np.isfinite(poses[..., 0])
    if not known.any():
        return None
    car = ego_rectangles(vehicle, result.trajectory.states[place, first:last].astype(np.float64))
    length_m, width_m = users.size_m[place].astype(np.float64).T
    away_m = np.hypot(*np.moveaxis(poses[..., :2] - car.centre_m[:, None], -1, 0))
    away_m = np.where(known, away_m, np.inf)
    # Outlines are nearer than centres by half of both widths at least, of both diagonals at most.
    most_m = (np.hypot(length_m, width_m) + np.hypot(car.length_m, car.width_m)) / 2.0
    least_m = (np.minimum(length_m, width_m) + min(car.length_m, car.width_m)) / 2.0
    at, who = np.nonzero(known & (away_m - most_m <= (away_m - least_m).min()))
    apart_m = clearance(
        Rectangles(car.centre_m[at], car.yaw_rad[at], car.length_m, car.width_m),
        Rectangles(poses[at, who, :2], poses[at, who, 2], length_m[who], width_m[who]),
    )
    # Of instants side by side the one in their middle.
    nearest = int(np.lexsort((away_m[at, who], apart_m.round(2)))[0])
    return _Whom(int(who[nearest]), first + int(at[nearest]))


def _kind(users: RoadUserTracks, place: int, number: int) -> RoadUserKind:
    return cast(RoadUserKind, users.kind_names[int(users.kinds[place, number])])
