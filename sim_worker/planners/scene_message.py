"""A view of some futures as a driving stack in another process is shown it."""

from __future__ import annotations

from typing import NamedTuple

import msgspec
import numpy as np

from foretwin.contracts.arrays import Array, Indices
from foretwin.contracts.planner_link import LINK_VERSION, PlannerScene
from foretwin.sim_worker.planner_interface import Briefing, PlannerView, rows_of

_NS_PER_S = 1e9


class Asked(NamedTuple):
    """Who asks, and the how-manieth of its questions it is; see PlannerScene."""

    run_id: str
    worker_id: str
    job: int
    question: int
    within_s: float
    reset: bool


def scene_message(
    view: PlannerView, asked: Asked, rows: Indices, briefing: Briefing | None
) -> PlannerScene:
    """Return the scene of the `rows` of a job; without a briefing, who is who is not told."""
    if len(rows) != len(view.arc_m):
        view = rows_of(view, rows)
    count, vehicle, path = len(rows), view.vehicle, view.path
    inside = (path.arc_m >= 0.0) & (path.arc_m <= path.length_m + 1e-6)
    stop = np.full(count, np.inf) if view.stop_arc_m is None else view.stop_arc_m
    scene = PlannerScene(
        run_id=asked.run_id,
        worker_id=asked.worker_id,
        job=asked.job,
        question=asked.question,
        futures=tuple(rows.tolist()),
        time_s=view.time_s,
        answer_within_s=asked.within_s,
        states=view.states,
        road_users=_road_users(view),
        path_xy_m=path.node_poses[inside, :2],
        speed_limit_mps=path.speed_limit_mps[inside],
        arc_m=view.arc_m,
        offset_m=view.offset_m,
        target_speed_mps=view.target_speed_mps,
        stop_arc_m=stop,
        length_m=vehicle.length_m.value,
        width_m=vehicle.width_m.value,
        rear_overhang_m=vehicle.rear_overhang_m.value,
        wheelbase_m=vehicle.wheelbase_m.value,
        link=LINK_VERSION,
        reset=asked.reset,
    )
    if briefing is None:
        return scene
    told, on_path = briefing.of_rows(rows), path.node_poses[inside]
    return msgspec.structs.replace(
        scene,
        stamp_ns=told.stamp_ns + round(view.time_s * _NS_PER_S),
        world_id=told.world_id,
        future_ids=told.future_ids,
        seeds=told.seeds,
        user_ids=told.user_ids,
        user_kinds=told.user_kinds,
        user_lane_ids=_user_lanes(view, told),
        path_lane_ids=told.lanes_at(on_path[:, :2], on_path[:, 2]),
        signals=dict(told.colours_at(view.time_s)),
    )


def _user_lanes(view: PlannerView, told: Briefing) -> tuple[tuple[str, ...], ...]:
    if view.users is None:
        return ((),) * len(view.arc_m)
    count, most, _ = view.users.poses.shape
    poses = view.users.poses.reshape(-1, 3)
    lanes = told.lanes_at(poses[:, :2], poses[:, 2])
    return tuple(lanes[row * most : (row + 1) * most] for row in range(count))


def _road_users(view: PlannerView) -> Array:
    users = view.users
    if users is None:
        return np.zeros((len(view.arc_m), 0, 7))
    found = np.concatenate(
        [users.poses, users.speed_mps[..., None], users.size_m, users.walks[..., None]], axis=2
    )
    return np.where(np.isnan(users.poses[..., :1]), np.nan, found)
