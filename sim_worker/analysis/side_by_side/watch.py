"""Human and ADS side by side while a drive goes on: plans wait until they have been driven.

A state machine without clock: statuses, plans and states in, disagreements out.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from foretwin.contracts.arrays import Array
from foretwin.contracts.drive import ControlMode, PlannedTrajectory, VehicleState, VehicleStatus
from foretwin.contracts.frames import LocalFrame, local_from_geo, local_from_geo_yaw
from foretwin.contracts.side_by_side import Disagreement, DrivenSegment
from foretwin.geometry.polyline import interpolated
from foretwin.geometry.recent_track import RecentTrack
from foretwin.sim_worker.analysis.side_by_side.departure import (
    Limits,
    departure,
    pace_kind,
    way_kind,
)
from foretwin.sim_worker.analysis.side_by_side.segment import (
    AspectWatch,
    DrivePlace,
    Segment,
    Waiting,
)
from foretwin.sim_worker.metrics.comparison import MAX_GAP_S
from foretwin.sim_worker.vehicle.commands import STEP_BACK_NS

HORIZON_S = 4.0
"""How much of a plan is compared: beyond, both have seen what was not known."""
_STEP_S = 0.1
_EVERY_NS = 200_000_000
"""Plans come ten times a second and hardly differ: every second one tells all."""
_LEAST_S = 1.0
_KEEP_NS = round((HORIZON_S + 3.0) * 1e9)
_LONGEST_HOLE_NS = round(MAX_GAP_S * 1e9)


class SegmentsStanding(NamedTuple):
    """How many segments have begun, and those that are not over."""

    begun: int
    open: tuple[Segment, ...]


class SideBySide:
    """Compares each plan with what was driven from its stamp on, up to the next takeover.

    A segment lasts as long as the control mode stays what it is; a status of unknown
    mode changes nothing. Figures are kept of every segment, disagreements of those in which a
    human drives. `place` says where the car is as a plan comes in.
    """

    def __init__(
        self,
        frame: LocalFrame,
        *,
        vehicle_id: str,
        place: Callable[[], DrivePlace],
    ) -> None:
        self._frame = frame
        self._vehicle_id = vehicle_id
        self._place = place
        self._limits = Limits()
        self._lowered = self._limits.lowered()
        self._driven = RecentTrack(4)
        self._last_plan_ns: int | None = None
        self._open: deque[Segment] = deque()
        self._ended: list[DrivenSegment] = []
        self._begun = 0

    @property
    def open_segments(self) -> list[DrivenSegment]:
        """The segments that are not over, as far as they are known."""
        return [segment.record() for segment in self._open]

    def take_ended(self) -> list[DrivenSegment]:
        """Return the segments that have ended since the last call, in their order.

        In each of them a plan came in or the control mode was told.
        """
        ended, self._ended = self._ended, []
        return ended

    @property
    def standing(self) -> SegmentsStanding:
        """Where the comparison stands, for one that goes on with it.

        Plans that wait count as too short: nobody sees what is driven until that one is there.
        """
        left = (
            replace(one, waiting=deque(), too_short=one.too_short + len(one.waiting))
            for one in self._open
        )
        return SegmentsStanding(self._begun, tuple(left))

    def go_on(self, standing: SegmentsStanding) -> None:
        """Begin where another one stood."""
        self._begun, self._open = standing.begun, deque(standing.open)

    def take_status(self, status: VehicleStatus) -> None:
        """Take the control mode; another than before is a takeover."""
        mode = status.control_mode
        if mode == "unknown" or (self._open and self._open[-1].mode == mode):
            return
        if self._open:
            before = self._open[-1]
            if before.mode == "unknown" and status.stamp_ns - before.from_ns < _LEAST_S * 1e9:
                before.mode = mode  # told a moment after the first plan, not taken over
                return
            if status.stamp_ns <= before.from_ns:
                return
            before.until_ns = status.stamp_ns
        self._begin(mode, status.stamp_ns)

    def take_plan(self, plan: PlannedTrajectory) -> None:
        """Take what the ADS plans now."""
        if not self._open:
            self._begin("unknown", plan.stamp_ns)
        last, segment = self._last_plan_ns, self._open[-1]
        if plan.stamp_ns < segment.from_ns or len(plan.time_from_stamp_s) < 2:
            return
        if last is not None and 0 <= plan.stamp_ns - last < _EVERY_NS:
            return
        self._last_plan_ns = plan.stamp_ns
        begin_s, end_s = float(plan.time_from_stamp_s[0]), float(plan.time_from_stamp_s[-1])
        first = max(0, int(np.ceil(begin_s / _STEP_S - 1e-6)))
        last_step = int(np.floor(min(end_s, HORIZON_S) / _STEP_S + 1e-6))
        time_s: Array = _STEP_S * np.arange(first, last_step + 1, dtype=np.float64)
        if len(time_s) < 2:
            return
        lat, lon = plan.lat_deg, plan.lon_deg
        yaw = np.unwrap(local_from_geo_yaw(self._frame, plan.yaw_rad, lat, lon))
        rows = np.column_stack([local_from_geo(self._frame, lat, lon), yaw, plan.speed_mps])
        segment.waiting.append(
            Waiting(
                stamp_ns=plan.stamp_ns,
                stamps_ns=plan.stamp_ns + np.round(time_s * 1e9),
                planned=interpolated(time_s, plan.time_from_stamp_s, rows),
                place=self._place(),
            )
        )

    def take_state(self, state: VehicleState) -> list[Disagreement]:
        """Take where the car is; return disagreements that begin to be told of, or end."""
        if not state.yaw_valid or self._last_plan_ns is None:
            return []  # what was driven before the first plan is compared with nothing
        last_ns = self._driven.last_ns
        if last_ns is not None and state.stamp_ns <= last_ns:
            if state.stamp_ns < last_ns - STEP_BACK_NS:
                return self._clock_stepped_back()
            return []
        lat, lon = state.position.lat_deg, state.position.lon_deg
        xy = local_from_geo(self._frame, lat, lon)
        yaw = float(local_from_geo_yaw(self._frame, state.yaw_rad, lat, lon))
        x, y = xy.tolist()
        self._driven.add(state.stamp_ns, (x, y, yaw, state.speed_mps))
        self._driven.forget(self._driven.since(state.stamp_ns - _KEEP_NS))
        if self._open:
            self._open[-1].last_ns = max(self._open[-1].last_ns, state.stamp_ns)
        return self._settle(state.stamp_ns)

    def finish(self) -> list[Disagreement]:
        """Compare what can still be compared at the drive's end, and end what lasts."""
        found = []
        if self._open and self._driven.last_ns is not None:
            last = self._open[-1]
            last.until_ns = self._driven.last_ns
            found = self._settle(self._driven.last_ns)
        return found + self._close_all()

    def _begin(self, mode: ControlMode, stamp_ns: int) -> None:
        number, self._begun = self._begun, self._begun + 1
        way = AspectWatch(self._vehicle_id, number, "way")
        pace = AspectWatch(self._vehicle_id, number, "pace")
        self._open.append(Segment(number, mode, stamp_ns, (way, pace), last_ns=stamp_ns))

    def _settle(self, now_ns: int) -> list[Disagreement]:
        """Compare the plans that have been driven, and end the segments that are over."""
        found: list[Disagreement] = []
        while self._open:
            segment = self._open[0]
            until_ns = segment.until_ns
            while segment.waiting:
                end_ns = segment.waiting[0].stamps_ns[-1]
                if now_ns < (end_ns if until_ns is None else min(end_ns, until_ns)):
                    break
                found += self._compare(segment, segment.waiting.popleft())
            if until_ns is None or now_ns < until_ns or segment.waiting:
                break
            if len(self._open) == 1:
                break  # the drive's end, not a takeover
            found += self._end(self._open.popleft())
        return found

    def _compare(self, segment: Segment, plan: Waiting) -> list[Disagreement]:
        upto = np.inf if segment.until_ns is None else segment.until_ns
        chosen = plan.stamps_ns <= upto
        segment.cut += not chosen.all()
        stamps = plan.stamps_ns[chosen]
        driven = self._driven_at(stamps) if len(stamps) > 1 else None
        if driven is None or stamps[-1] - plan.stamp_ns < _LEAST_S * 1e9:
            segment.too_short += 1
            return []
        found = departure(plan.planned[chosen], driven)
        segment.count(found)
        if segment.mode != "manual":
            return []
        told: list[Disagreement] = []
        for aspect, kind_of in zip(segment.aspects, (way_kind, pace_kind), strict=True):
            kind = kind_of(found, self._limits)
            within = kind_of(found, self._lowered) is None
            told += aspect.take(plan.stamp_ns, kind, within, found, plan.place)
        segment.disagreements += sum(one.over for one in told)
        return told

    def _driven_at(self, stamps_ns: Array) -> Array | None:
        known = self._driven.stamps_ns
        if len(known) < 2 or known[0] > stamps_ns[0] or known[-1] < stamps_ns[-1]:
            return None
        first = int(np.searchsorted(known, stamps_ns[0], side="right")) - 1
        stretch = slice(first, int(np.searchsorted(known, stamps_ns[-1])) + 1)
        known, rows = known[stretch], self._driven.rows[stretch].copy()
        if (np.diff(known) > _LONGEST_HOLE_NS).any():
            return None
        rows[:, 2] = np.unwrap(rows[:, 2])
        return interpolated(stamps_ns, known.astype(np.float64), rows)

    def _clock_stepped_back(self) -> list[Disagreement]:
        """Nothing of before can be compared any more: a new segment by the new clock."""
        told = self._close_all()
        self._driven.clear()
        self._last_plan_ns = None
        return told

    def _close_all(self) -> list[Disagreement]:
        found = []
        while self._open:
            segment = self._open.popleft()
            segment.too_short += len(segment.waiting)
            segment.waiting.clear()
            found += self._end(segment)
        return found

    def _end(self, segment: Segment) -> list[Disagreement]:
        found = [one for aspect in segment.aspects for one in aspect.finish()]
        segment.disagreements += len(found)
        self._ended.append(segment.record())
        return found
