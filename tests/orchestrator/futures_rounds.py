"""Complete rounds made by hand: trajectories are given, everything else is plain."""

from __future__ import annotations

import numpy as np

from foretwin.contracts.arrays import Array
from foretwin.contracts.futures import (
    Future,
    FuturesResult,
    Job,
    Outcome,
    PathAhead,
    RoadUserTracks,
    Trajectory,
)
from foretwin.orchestrator.runner.open_rounds import RoundDone, RoundOrder
from tests.orchestrator.trip import START_NS, states_along, town_world

TIME_S = np.arange(81) * 0.1


def nobody(count: int, instants: int) -> RoadUserTracks:
    """The tracks of futures in which no one else is on the road."""
    return RoadUserTracks(
        poses=np.empty((count, instants, 0, 3), dtype=np.float32),
        speed_mps=np.empty((count, instants, 0), dtype=np.float32),
        size_m=np.empty((count, 0, 2), dtype=np.float32),
        kinds=np.empty((count, 0)),
        kind_names=(),
    )


def futures(count: int, scenario_id: str = "") -> tuple[Future, ...]:
    return tuple(
        Future(index=i, name=f"future {i}" if i else "nominal", scenario_id=scenario_id)
        for i in range(count)
    )


def straight(
    xy_m: tuple[float, float] = (0.0, 0.0),
    *,
    yaw_rad: float = 0.0,
    speed_mps: float = 10.0,
    time_s: Array = TIME_S,
) -> Array:
    """States (1, N, 8) of a car that drives straight on at one speed."""
    states = np.zeros((1, len(time_s), 8))
    states[0, :, 0] = xy_m[0] + speed_mps * time_s * np.cos(yaw_rad)
    states[0, :, 1] = xy_m[1] + speed_mps * time_s * np.sin(yaw_rad)
    states[0, :, 2], states[0, :, 3] = yaw_rad, speed_mps
    return states


def round_done(
    *jobs: Array,
    round_id: int = 0,
    stamp_ns: int = START_NS,
    time_s: Array = TIME_S,
    outcome: dict[str, Array] | None = None,
    latency_ms: float = 100.0,
    scenario_id: str = "",
) -> RoundDone:
    """A round whose jobs gave these states (S, N, 8); `outcome` replaces fields of every job's."""
    orders, results, first = [], [], 0
    for index, states in enumerate(jobs):
        count = len(states)
        fields = {
            "collided": np.zeros(count, dtype=bool),
            "collision_time_s": np.full(count, np.nan),
            "collision_with": np.zeros(count, dtype=np.int64),
            "min_clearance_m": np.full(count, np.nan),
            "progress_m": np.full(count, 80.0),
            "valid": np.ones(count, dtype=bool),
        }
        results.append(
            FuturesResult(
                round_id=round_id, job_index=index, worker_id=f"w{index}", world_id="w",
                future_indices=tuple(range(first, first + count)),
                trajectory=Trajectory(
                    stamp_ns=stamp_ns, time_s=time_s, states=states.astype(np.float32)
                ),
                road_users=nobody(count, len(time_s)),
                metrics={}, accidents=(), left_out=("",) * count,
                outcome=Outcome(**(fields | (outcome or {}))),
                sim_seconds=8.0 * count, cpu_seconds=0.5, wall_seconds=0.5,
            )
        )  # fmt: skip
        orders.append(
            Job(
                round_id=round_id, job_index=index, world_id="w",
                state=states_along(town_world("n4").frame, np.array([[0.0, 0.0], [5.0, 0.0]]))[0],
                path=PathAhead(xy_m=np.zeros((2, 2)), speed_limit_mps=np.ones(2)),
                futures=futures(first + count, scenario_id)[first:], horizon_s=8.0, step_s=0.1,
                seed=0, accidents=True, cruise_speed_mps=10.0,
            )
        )  # fmt: skip
        first += count
    return RoundDone(
        order=RoundOrder(
            round_id=round_id, stamp_ns=stamp_ns, junction_id="n4", world_id="w",
            receipt_mono_ns=0, started_mono_ns=0, jobs=tuple(orders),
        ),
        results=tuple(results),
        latency_ms=latency_ms,
        seconds=latency_ms / 1000.0,
    )  # fmt: skip
