"""What a driving stack has answered for some futures, and what of it counts from when."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from foretwin.contracts.arrays import Array, Flags, Indices
from foretwin.contracts.planner_link import MOST_TOOK_S, PlannedMotions, other_link
from foretwin.sim_worker.driver_model import HOLD_SPEED_MPS
from foretwin.sim_worker.planner_interface import PlannerOutput, PlannerView
from foretwin.sim_worker.planners.trajectory_tracking import Trajectories, check_trajectories, track

_TICK_S = 1e-6
"""Ticks come a hair before or after their instants."""
_LATEST_BEGIN_S = 1.0
"""Chosen: stacks that leave out the present have steps of up to half a second; who begins later
counts from another instant than the question's."""
_FARTHEST_BEGIN_M = 10.0
"""Beside what the car drives until its motion begins. Chosen: more than cars are ever beside what
they track, less than most are from the origin of their own axes, or of another map's."""


class _Answer(NamedTuple):
    """Trajectories of those of `place` that are not negative."""

    motions: Trajectories
    place: Indices

    @property
    def known(self) -> Flags:
        return np.asarray(self.place >= 0)


class AnsweredMotions:
    """The motions of `count` futures: those that they track, and those that are still to count."""

    def __init__(self, count: int, *, rate_hz: float, latency_s: float) -> None:
        """`rate_hz` is how often a stack is asked, `latency_s` what it takes unless it says so."""
        self._count, self._every_s, self._latency_s = count, 1.0 / rate_hz, latency_s
        self._now: _Answer | None = None
        self._next: _Answer | None = None
        self._counts_from_s = self._ask_from_s = -math.inf

    def due(self, time_s: float) -> bool:
        """Whether the stack is to be asked: it is at no answer any more, and its period is over."""
        if self._next is not None and time_s >= self._counts_from_s - _TICK_S:
            self._now, self._next = self._next, None
        return time_s >= self._ask_from_s - _TICK_S

    def asked(self, time_s: float) -> None:
        """Take note that the stack was asked."""
        self._ask_from_s = time_s + self._every_s

    @property
    def known(self) -> Flags:
        """(count,) whose motion is known, now and from the last answer on."""
        both = [one.known for one in (self._now, self._next) if one is not None]
        return np.asarray(np.logical_and.reduce(both)) if both else np.zeros(self._count, bool)

    def drop_ended(self, time_s: float) -> dict[int, str]:
        """Know no more of motions that have ended, and did not come to rest; returns which, and
        why: where such a car would be now, nobody has said."""
        now = self._now
        if now is None or not len(now.motions.time_s):
            return {}
        end_s = float(now.motions.time_s[0, -1])
        if time_s <= end_s + _TICK_S:
            return {}
        rows = np.flatnonzero(now.known)
        rows = rows[np.abs(now.motions.speed_mps[now.place[rows], -1]) >= HOLD_SPEED_MPS]
        place = now.place.copy()
        place[rows] = -1
        self._now = now._replace(place=place)
        why = f"its motion ended at {end_s:g} s, not at rest, before another one counted"
        return dict.fromkeys(rows.tolist(), why)

    def forget(self) -> None:
        """Know of no motion any more."""
        self._now = self._next = None

    def take(
        self, answer: PlannedMotions, asked: Indices, asked_s: float, states: Array
    ) -> dict[int, str]:
        """Keep an answer to a question about the rows `asked` of `states` (count, 8); returns for
        which of them there is no motion in it, and why. Raises ValueError in words for one of no
        use."""
        if wrong := other_link(answer.link):
            raise ValueError(wrong)
        if answer.failure:
            raise ValueError(answer.failure)
        took_s = self._latency_s if answer.took_s is None else answer.took_s
        if not 0.0 <= took_s <= MOST_TOOK_S:
            raise ValueError(f"took_s {took_s:g}: 0 to {MOST_TOOK_S:g} s")
        rows = np.array(answer.futures, dtype=np.intp)
        if not set(rows.tolist()) <= set(asked.tolist()) or len(set(rows.tolist())) < len(rows):
            raise ValueError(f"futures {answer.futures} of {_words(asked)}")
        time_s = np.broadcast_to(answer.time_s, (len(rows), *np.shape(answer.time_s))) + asked_s
        motions = Trajectories(time_s, answer.xy_m, answer.yaw_rad, answer.speed_mps)
        why = dict.fromkeys(map(int, asked), "the answer left it out")
        if len(rows):
            fine = _finite(motions)
            why |= dict.fromkeys(map(int, rows[~fine]), "the answer holds what is no number")
            motions, rows = _only(motions, fine), rows[fine]
            if len(rows):
                check_trajectories(motions)
                _check_times(answer.time_s, took_s)
                apart = _undrivable(motions, states[rows], float(answer.time_s[0]))
                why |= {int(rows[place]): words for place, words in apart.items()}
                fine = ~np.isin(np.arange(len(rows)), list(apart))
                motions, rows = _only(motions, fine), rows[fine]
        place = np.full(self._count, -1, dtype=np.intp)
        place[rows] = np.arange(len(rows))
        received = _Answer(motions, place)
        if self._now is None or took_s == 0.0:
            self._now, self._next = received, None
        else:
            self._next, self._counts_from_s = received, asked_s + took_s
            periods = max(math.ceil((took_s - _TICK_S) / self._every_s), 1)
            self._ask_from_s = asked_s + periods * self._every_s
        for row in rows.tolist():
            del why[row]
        return why

    def track(self, view: PlannerView, rows: Indices) -> PlannerOutput:
        """Return commands that lead the cars of known rows along their motions."""
        assert self._now is not None
        place = self._now.place[rows]
        mine = Trajectories._make(values[place] for values in self._now.motions)
        return track(view, mine, time_s=view.time_s)


def _finite(motions: Trajectories) -> Flags:
    """(S,) whose motion is all numbers; raises ValueError where there are not as many of each."""
    count = len(motions.time_s)
    for name, values in zip(motions._fields, motions, strict=True):
        if not values.ndim or len(values) != count:
            raise ValueError(f"{name} of shape {values.shape} for {count} futures")
    flat = [values.reshape(count, -1) for values in motions]
    return np.asarray(np.logical_and.reduce([np.isfinite(one).all(axis=1) for one in flat]))


def _only(motions: Trajectories, fine: Flags) -> Trajectories:
    return Trajectories._make(one[fine] for one in motions)


def _undrivable(motions: Trajectories, states: Array, begin_s: float) -> dict[int, str]:
    """Return which motions no car in one of `states` (S, 8) can be led along, and why."""
    away_m = np.hypot(*(motions.xy_m[:, 0] - states[:, :2]).T)
    far = away_m > _FARTHEST_BEGIN_M + begin_s * np.abs(states[:, 3])
    back_mps = motions.speed_mps.min(axis=1)
    wrong = {
        int(row): f"it drives backwards, at {back_mps[row]:.1f} m/s: cars of a stack go ahead alone"
        for row in np.flatnonzero(back_mps < -HOLD_SPEED_MPS)
    }
    return wrong | {
        int(row): f"its motion begins {away_m[row]:.0f} m from its car: xy_m is where base_link is "
        "in the World's frame"
        for row in np.flatnonzero(far)
    }


def _check_times(time_s: Array, took_s: float) -> None:
    """Raise ValueError where a motion says nothing of the time in which it counts."""
    begin_s, end_s = float(time_s[0]), float(time_s[-1])
    if begin_s > _LATEST_BEGIN_S:
        raise ValueError(
            f"time_s begins at {begin_s:g} s; it counts from the question's instant, "
            f"{_LATEST_BEGIN_S:g} s is the latest"
        )
    if end_s <= took_s:
        raise ValueError(
            f"time_s ends at {end_s:g} s; it counts from the question's instant, and the answer "
            f"from {took_s:g} s on"
        )


def _words(rows: Indices) -> str:
    return f"{len(rows)} that were asked for, {rows.min()} to {rows.max()}"
