"""Holds the nominal futures until reality has caught up with them, then compares."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, field

import numpy as np

from foretwin.contracts.arrays import Array
from foretwin.contracts.drive import PlannedTrajectory, VehicleState
from foretwin.contracts.frames import (
    LocalFrame,
    local_from_geo,
    local_from_geo_yaw,
    target_from_source,
    target_from_source_m,
)
from foretwin.contracts.futures import PathAhead
from foretwin.contracts.simulation import HORIZONS_S, Comparison, PlanComparison
from foretwin.contracts.trace import traced
from foretwin.contracts.world import World
from foretwin.geometry.recent_track import RecentTrack
from foretwin.orchestrator.rounds.jobs import PLAN_FRESH_NS
from foretwin.orchestrator.runner.open_rounds import RoundDone, RoundOrder
from foretwin.sim_worker.metrics.comparison import (
    ActualTrack,
    NominalTrack,
    compare_nominal,
    compare_plan,
)

LEAD_NS = 1_000_000_000
"""How much of the real track before a future's beginning goes into its comparison."""
KEEP_S = 5.0
"""How long the real track is kept beyond the longest horizon."""


@dataclass(slots=True)
class OpenComparisons:
    """Takes states and rounds in the order of their stamps, gives comparisons as they fall due.

    `truth` positions are those that the vehicle measured: what is compared with is never smoothed
    with knowledge of the future, so that a live drive and a replay give the same numbers.
    """

    frame: LocalFrame
    horizon_s: float
    _driven: RecentTrack = field(default_factory=lambda: RecentTrack(3))
    _waiting: deque[tuple[NominalTrack, RoundOrder]] = field(default_factory=deque)

    @property
    def horizons_s(self) -> tuple[float, ...]:
        """The horizons that a future of this length covers."""
        return tuple(h for h in HORIZONS_S if h <= self.horizon_s + 1e-9)

    def take_state(self, state: VehicleState) -> list[Comparison]:
        """Add where the car is; return the comparisons that this completes."""
        last_ns = self._driven.last_ns
        if last_ns is not None and state.stamp_ns < last_ns - LEAD_NS:
            # The vehicle's clock has stepped back: nothing of before can be compared any more.
            self._driven.clear()
            self._waiting.clear()
            last_ns = None
        if not state.yaw_valid or (last_ns is not None and state.stamp_ns <= last_ns):
            return []
        lat, lon = state.position.lat_deg, state.position.lon_deg
        # What the map moves the position by is no motion that a future could have foreseen.
        x, y = (local_from_geo(self.frame, lat, lon) - _shift_m(state)).tolist()
        yaw = float(local_from_geo_yaw(self.frame, state.yaw_rad, lat, lon))
        self._driven.add(state.stamp_ns, (x, y, yaw))
        due_ns = state.stamp_ns - round(max(self.horizons_s) * 1e9)
        done = []
        while self._waiting and self._waiting[0][0].stamp_ns <= due_ns:
            done += self._compare(*self._waiting.popleft())
        self._forget(state.stamp_ns)
        return done

    def take_round(
        self,
        done: RoundDone,
        world_frame: LocalFrame,
        seed: VehicleState,
        weights: Array | None = None,
    ) -> None:
        """Add a round's nominal future, the first of its first job, and the mean of all by their
        `weights` (S,). A round of the same state as the one before is no further evidence."""
        trajectory = done.results[0].trajectory
        if self._waiting and self._waiting[-1][0].stamp_ns == trajectory.stamp_ns:
            return
        states = np.asarray(trajectory.states[0], dtype=np.float64)
        poses = target_from_source(self.frame, world_frame, states[:, :2], states[:, 2])
        xy = poses.xy_m - _shift_m(seed)
        nominal = NominalTrack(
            stamp_ns=trajectory.stamp_ns,
            time_s=np.asarray(trajectory.time_s),
            xy_yaw=np.column_stack([xy, poses.yaw_rad]),
            speed_mps=seed.speed_mps,
            yaw_rate_radps=seed.yaw_rate_radps,
            mean_xy=None if weights is None else self._mean_xy(done, world_frame, seed, weights),
        )
        self._waiting.append((nominal, done.order))

    def _mean_xy(
        self, done: RoundDone, world_frame: LocalFrame, seed: VehicleState, weights: Array
    ) -> Array | None:
        """Return (N, 2) where futures are in the mean; None where none is likely at all."""
        if weights.sum() <= 0.0:
            return None
        xy = np.concatenate([result.trajectory.states[:, :, :2] for result in done.results])
        some = weights > 0.0  # what diverged is nowhere
        mean = np.average(xy[some].astype(np.float64), axis=0, weights=weights[some])
        moved: Array = target_from_source_m(self.frame, world_frame, mean) - _shift_m(seed)
        return moved

    def flush(self) -> list[Comparison]:
        """Return what can still be compared over the horizons that the drive has covered."""
        done = []
        while self._waiting:
            done += self._compare(*self._waiting.popleft())
        return done

    @traced("compare a round")
    def _compare(self, nominal: NominalTrack, order: RoundOrder) -> list[Comparison]:
        # The same stretch whenever this is called: unwrapping angles from another start would
        # change their last digits, and a cut log the results before the cut.
        kept = slice(self._driven.since(nominal.stamp_ns - LEAD_NS), None)
        track = ActualTrack(stamps_ns=self._driven.stamps_ns[kept], xy_yaw=self._driven.rows[kept])
        return compare_nominal(
            nominal,
            track,
            horizons_s=self.horizons_s,
            round_id=order.round_id,
            intersection_id=order.junction_id,
        )

    def _forget(self, now_ns: int) -> None:
        oldest = now_ns - round((self.horizon_s + KEEP_S) * 1e9)
        if self._waiting:
            oldest = min(oldest, self._waiting[0][0].stamp_ns - LEAD_NS)
        # The one before the oldest that is wanted stays, to interpolate from.
        self._driven.forget(min(self._driven.since(oldest) - 1, len(self._driven) - 2))


def plan_compared(
    done: RoundDone,
    plan: PlannedTrajectory | None,
    state: VehicleState,
    path: PathAhead,
    world: World,
) -> PlanComparison | None:
    """Return the car's own plan against a round's nominal future, None where it sent none lately.

    `state` and `path` are those that the round began with.
    """
    if plan is None or state.stamp_ns - plan.stamp_ns > PLAN_FRESH_NS:
        return None
    return compare_plan(
        plan,
        done.results[0].trajectory,
        path,
        world_frame=world.frame,
        round_id=done.order.round_id,
    )


def _shift_m(state: VehicleState) -> Array:
    return np.array(state.map_shift_m or (0.0, 0.0))
