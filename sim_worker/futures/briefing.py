"""What a driving stack is told of a job before its first tick."""

from __future__ import annotations

import msgspec

from foretwin.contracts.futures import Job, PlannerTiming
from foretwin.contracts.job_identity import future_id, job_bytes
from foretwin.sim_worker.futures.future_rows import road_user_names
from foretwin.sim_worker.futures.scene import JobScene, SceneMaker
from foretwin.sim_worker.planner_interface import Briefing
from foretwin.sim_worker.road_users.cast import KIND_NAMES
from foretwin.sim_worker.road_users.manners import key_of


def briefing_of(given: Job, played: Job, maker: SceneMaker, scene: JobScene) -> Briefing:
    """Return the briefing of the futures that are `played` of the job that was `given`."""
    sha256, timing = job_bytes(given).sha256, given.planner_timing
    if isinstance(timing, msgspec.UnsetType):
        timing = PlannerTiming()
    there: list[list[bool]] = [[] for _ in played.futures]
    kinds: list[list[int]] = [[] for _ in played.futures]
    if scene.traffic is not None:
        crowd = scene.traffic.crowd
        there, kinds = crowd.present.tolist(), crowd.kinds.tolist()
    names = [road_user_names(given, future) for future in played.futures]
    return Briefing(
        world_id=given.world_id,
        stamp_ns=given.state.stamp_ns,
        future_ids=tuple(future_id(sha256, future.index) for future in played.futures),
        seeds=tuple(key_of(given.seed, one.name, one.place) for one in played.futures),
        user_ids=tuple(
            tuple(one[r] if here else "" for r, here in enumerate(row))
            for row, one in zip(there, names, strict=True)
        ),
        user_kinds=tuple(
            tuple(KIND_NAMES[kind] if here else "" for here, kind in zip(row, one, strict=True))
            for row, one in zip(there, kinds, strict=True)
        ),
        colours_at=scene.lights.at,
        lanes_at=maker.lanes.lookup.at,
        rate_hz=timing.rate_hz,
        latency_s=timing.latency_s,
    )
