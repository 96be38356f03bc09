"""A planner that samples motions along and across its path and takes the best one free of others.

Werling, Ziegler, Kammel, Thrun (2010), Optimal trajectory generation for dynamic street scenarios
in a Frenet frame, ICRA: quartic and quintic polynomials of time along the path (keeping a speed,
stopping at a line, following) and across it (offsets), combined, checked, and rated by jerk, time
and distance from what is wanted. All cars and all candidates are arrays.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from foretwin.contracts.arrays import Array, Flags, Indices
from foretwin.sim_worker.driver_model import HOLD_MPS2, HOLD_SPEED_MPS, MAX_DECEL_MPS2
from foretwin.sim_worker.planner_interface import PlannerOutput, PlannerView, SeenUsers, rows_of
from foretwin.sim_worker.planners.lattice_choice import Planned, choose
from foretwin.sim_worker.planners.lattice_rating import (
    CANDIDATE_ACCEL_MPS2,
    still_free,
)
from foretwin.sim_worker.planners.polynomials import Motions
from foretwin.sim_worker.planners.prediction import Changes, changes
from foretwin.sim_worker.planners.tracking import pure_pursuit
from foretwin.sim_worker.vehicle.resistance import resistance_mps2

REPLAN_S = 0.5
_AT_ONCE_S, _LEAD_BRAKES_MPS2 = 0.15, 2.5
"""Sooner where the lead brakes harder than this."""
_TURNS_RADPS, _GAINS_MPS = 0.15, 1.0
"""Who turns or drives otherwise by more than when a motion was chosen is looked at again."""
MotionPair = tuple[Motions, Motions]
"""Along the path and across it."""
_LOOKAHEAD_S, _PREVIEW_S = 0.6, 0.1
_SPEED_GAIN, _PLACE_GAIN = 1.2, 0.3


class FrenetLattice:
    """Evades within its lane, follows, stops for lights and others, and gives way.

    Without memory, it plans at every tick; driving a job it does so every half second.
    """

    def plan(self, view: PlannerView) -> PlannerOutput:
        """Answer one control tick."""
        return LatticeDriver(preview_s=REPLAN_S).plan(view)

    def begin(self, count: int) -> LatticeDriver:
        """Return what drives the cars of one job."""
        return LatticeDriver()


class LatticeDriver:
    """Follows the motions chosen last, and chooses anew every half second, or when it has to."""

    remarks: Mapping[int, str] = {}

    def __init__(self, *, preview_s: float = _PREVIEW_S) -> None:
        """`preview_s`: over so much of the plan's beginning its acceleration is taken, as the
        plan begins with the present one."""
        self._preview_s = preview_s
        self._chosen: MotionPair | None = None
        self._since_s: Array | float = -np.inf
        self._looked_s = 0.0
        self._seen: SeenUsers | None = None
        self._lead_mps: Array | None = None
        self._next_s = np.inf
        self._known: tuple[Array, Array] | None = None
        """How others turned and how fast they were when motions were looked at last."""

    def plan(self, view: PlannerView) -> PlannerOutput:
        """Answer one control tick."""
        passed_s = np.broadcast_to(view.time_s - self._since_s, view.arc_m.shape)
        changing = self._changes(view)
        if self._chosen is None:
            due = np.ones(len(passed_s), dtype=bool)
            chosen = choose(view)
        else:
            chosen = self._chosen
            due = self._due(chosen, view, passed_s, changing)
            if due.any():
                chosen = self._renewed(chosen, view, np.flatnonzero(due), passed_s, changing)
        if self._chosen is None or view.time_s > self._next_s - 1e-6:
            self._next_s = view.time_s + REPLAN_S
        self._note(view, due, changing)
        self._chosen = chosen
        self._since_s = np.where(due, view.time_s, self._since_s)
        self._looked_s, self._seen = view.time_s, view.users
        self._lead_mps = view.lead_speed_mps
        along, across = chosen
        now = np.where(due, 0.0, passed_s)
        place = along.place_at(now)
        speed, later = along.speed_at(np.stack([now, now + self._preview_s]))
        accel = (later - speed) / self._preview_s
        offset = np.asarray(across.place_at(now + _LOOKAHEAD_S), dtype=np.float64)
        angle = pure_pursuit(view._replace(desired_offset_m=offset))
        present = view.states[:, 3]
        command = accel + _SPEED_GAIN * (speed - present) + _PLACE_GAIN * (place - view.arc_m)
        command = np.minimum(np.maximum(command, -MAX_DECEL_MPS2), CANDIDATE_ACCEL_MPS2)
        hold = (present < HOLD_SPEED_MPS) & (speed < HOLD_SPEED_MPS) & (accel < HOLD_SPEED_MPS)
        command = command + resistance_mps2(view.vehicle, present, view.climb_mps2)
        return PlannerOutput(np.where(hold, HOLD_MPS2, command), angle)

    def _due(
        self,
        chosen: MotionPair,
        view: PlannerView,
        passed_s: Array,
        changing: Changes | None,
    ) -> Flags:
        """Return (S,) which cars choose anew: all at the same times, some in between."""
        if view.time_s > self._next_s - 1e-6:
            return np.ones(len(passed_s), dtype=bool)
        due = np.zeros(len(passed_s), dtype=bool)
        if view.users is not None and self._seen is not None:
            new = np.isfinite(view.users.arc_m) & ~np.isfinite(self._seen.arc_m)
            due |= new.any(axis=1)
        if self._lead_mps is not None:
            least = _LEAD_BRAKES_MPS2 * (view.time_s - self._looked_s)
            braking = self._lead_mps - view.lead_speed_mps > least
            due |= braking & (passed_s > _AT_ONCE_S)
        return due | self._endangered(chosen, view, passed_s, changing, ~due)

    def _changes(self, view: PlannerView) -> Changes | None:
        if view.users is None or self._seen is None:
            return None
        return changes(self._seen, view.users, passed_s=view.time_s - self._looked_s)

    def _endangered(
        self,
        chosen: MotionPair,
        view: PlannerView,
        passed_s: Array,
        changing: Changes | None,
        open_: Flags,
    ) -> Flags:
        """Return (S,) of the `open_` ones whose motion leads into a road user that drives otherwise
        than when that was looked at last."""
        endangered = np.zeros(len(view.arc_m), dtype=bool)
        users, known = view.users, self._known
        if users is None or changing is None or known is None:
            return endangered
        new = np.abs(changing.yaw_rate_radps - known[0]) > _TURNS_RADPS
        new |= np.abs(users.speed_mps - known[1]) > _GAINS_MPS
        rows = np.flatnonzero(new.any(axis=1) & open_)
        if not len(rows):
            return endangered
        known[0][rows], known[1][rows] = changing.yaw_rate_radps[rows], users.speed_mps[rows]
        along, across = chosen[0].of(rows), chosen[1].of(rows)
        changing = Changes(*(values[rows] for values in changing))
        free = still_free(rows_of(view, rows), along, across, passed_s[rows], changing)
        endangered[rows] = ~free
        return endangered

    def _note(self, view: PlannerView, due: Flags, changing: Changes | None) -> None:
        """Remember how others drive as motions are chosen."""
        if view.users is None:
            return
        speed = view.users.speed_mps
        turns = np.zeros_like(speed) if changing is None else changing.yaw_rate_radps
        if self._known is None or self._known[1].shape != speed.shape:
            self._known = turns.copy(), speed.copy()
        else:
            self._known[0][due], self._known[1][due] = turns[due], speed[due]

    def _renewed(
        self,
        chosen: MotionPair,
        view: PlannerView,
        rows: Indices,
        passed_s: Array,
        changing: Changes | None,
    ) -> MotionPair:
        """Return the motions with those of some rows chosen anew."""
        if len(rows) == len(passed_s):
            return choose(view, _planned(*chosen, passed_s), changing)
        along, across = chosen
        before = _planned(along.of(rows), across.of(rows), passed_s[rows])
        if changing is not None:
            changing = Changes(*(values[rows] for values in changing))
        for old, new in zip(chosen, choose(rows_of(view, rows), before, changing), strict=True):
            old.coefficients[:, rows] = new.coefficients
            old.end_s[rows] = new.end_s
        return chosen


def _planned(along: Motions, across: Motions, passed_s: Array) -> Planned:
    """Return the acceleration along, and place, speed, acceleration across, that were planned."""
    return (along.at(passed_s)[2], *across.at(passed_s))
