"""The planner `remote` of a drive: a driving stack that somebody has started beside it.

Each 0.1 s of a future the stack is shown all road users and says where it would drive; cars track
that. A live drive waits for it until a deadline of wall time, since its rounds have one; in lock
step so long that only who hangs misses it. Where the stack says nothing of use, a named planner
acts instead and the future is marked.
"""

from __future__ import annotations

import itertools
import time
from collections.abc import Iterable
from typing import NamedTuple

import numpy as np

from foretwin.contracts.bus import Bus, Mailbox, Received
from foretwin.contracts.futures import PlannerTiming
from foretwin.contracts.planner_link import PlannedMotions, PlannerScene
from foretwin.sim_worker.planner_interface import (
    Briefing,
    Planner,
    PlannerOutput,
    PlannerView,
    rows_of,
)
from foretwin.sim_worker.planners.answered_motions import AnsweredMotions
from foretwin.sim_worker.planners.hosted import ALIVE_S, ANSWER_S, FIRST_ANSWER_S
from foretwin.sim_worker.planners.pure_pursuit_idm import PurePursuitIdm
from foretwin.sim_worker.planners.scene_message import Asked, scene_message

REPEAT_S = 0.25
"""The first question of a job is repeated: the stack may be joining the bus."""
_PATIENCE = 3
"""After so many questions in vain, a job waits for no more answers."""


class _Connection(NamedTuple):
    bus: Bus
    run: str
    process: str
    answers: Mailbox


class RemotePlanner:
    """The planner named `remote`; drives once its worker has connected it to the bus."""

    def __init__(
        self,
        fallback: Planner | None = None,
        *,
        fallback_name: str = "pure_pursuit_idm",
        first_answer_s: float = FIRST_ANSWER_S,
        answer_s: float = ANSWER_S,
        alive_s: float = ALIVE_S,
    ) -> None:
        self.fallback = PurePursuitIdm() if fallback is None else fallback
        self.fallback_name = fallback_name
        self.first_answer_s, self.answer_s, self.alive_s = first_answer_s, answer_s, alive_s
        self.lock_step = self.gone = False
        """Whether no clock runs; whether nobody answered there, however long it was waited for."""
        self._connection: _Connection | None = None
        self._jobs = itertools.count()

    def connect(self, bus: Bus, *, run: str, process: str, lock_step: bool = False) -> None:
        """Ask over `bus` as the worker `process` of a run."""
        answers = Mailbox(16)
        bus.subscribe("planned_motions", answers, run=run, process=process)
        self._connection = _Connection(bus, run, process, answers)
        self.lock_step = lock_step

    def begin(self, count: int) -> RemoteDriver:
        """Return what drives one job's cars, of which the stack is told their motion alone."""
        return RemoteDriver(self, self._connection, next(self._jobs), count, None)

    def begin_briefed(self, briefing: Briefing) -> RemoteDriver:
        """Return what drives one job's cars."""
        count = len(briefing.future_ids)
        return RemoteDriver(self, self._connection, next(self._jobs), count, briefing)

    def plan(self, view: PlannerView) -> PlannerOutput:
        """Answer one control tick as the first of a job."""
        return self.begin(len(view.arc_m)).plan(view)

    def within_s(self, *, first: bool) -> float:
        """Return how long an answer is waited for."""
        if self.lock_step and not self.gone:
            return self.alive_s
        return self.first_answer_s if first else self.answer_s


class RemoteDriver:
    """Requests, waits, and tracks the answer; `remarks` say where the fallback had to act."""

    def __init__(
        self,
        planner: RemotePlanner,
        connection: _Connection | None,
        job: int,
        count: int,
        briefing: Briefing | None,
    ) -> None:
        self._planner, self._connection, self._job = planner, connection, job
        self._briefing = briefing
        self.remarks: dict[int, str] = {}
        self._question, self._misses = 0, 0
        self._stack = 0
        """Who answered last, by its number on the bus."""
        timing = PlannerTiming()
        self._motions = AnsweredMotions(count, rate_hz=timing.rate_hz, latency_s=timing.latency_s)
        self._rows = np.arange(count)

    def plan(self, view: PlannerView) -> PlannerOutput:
        """Answer one control tick; raises ValueError where there is no bus to ask over."""
        if self._connection is None:
            raise ValueError("planner 'remote' asks over the bus of a run; there is none here")
        if self._motions.due(view.time_s):
            self._motions.asked(view.time_s)
            self._ask(view, self._connection)
        for row, why in self._motions.drop_ended(view.time_s).items():
            self._fall_back([row], view.time_s, why)
        known = self._motions.known
        if known.all():
            return self._motions.track(view, self._rows)
        output = self._planner.fallback.plan(view)
        if not known.any():
            return output
        rows = np.flatnonzero(known)
        tracked = self._motions.track(rows_of(view, rows), rows)
        accel, angle = output.accel_mps2.copy(), output.tire_angle_rad.copy()
        accel[rows], angle[rows] = tracked
        return PlannerOutput(accel, angle)

    def _ask(self, view: PlannerView, link: _Connection) -> None:
        first = self._question == 0
        self._question += 1
        within_s = self._planner.within_s(first=first)
        asked = Asked(link.run, link.process, self._job, self._question, within_s, first)
        scene = scene_message(view, asked, self._rows, self._briefing)
        waits_s = within_s if self._misses < _PATIENCE else 0.0
        answer = self._answer(scene, link, waits_s, repeats=first)
        if answer is None:
            self._misses += 1
            self._planner.gone = True
            self._motions.forget()
            self._fall_back(self._rows, view.time_s, f"no answer within {within_s:g} s")
            return
        self._misses, self._planner.gone = 0, False
        try:
            if isinstance(answer, ValueError):
                raise answer
            missing = self._motions.take(answer, self._rows, view.time_s, view.states)
        except (TypeError, ValueError) as error:
            self._motions.forget()
            self._fall_back(self._rows, view.time_s, f"no use: {error}")
            return
        for row, why in missing.items():
            self._fall_back([row], view.time_s, why)

    def _answer(
        self, scene: PlannerScene, link: _Connection, within_s: float, *, repeats: bool
    ) -> PlannedMotions | ValueError | None:
        """Return the answer to this very question, why it is none, or None at the deadline."""
        end = time.monotonic() + within_s
        again = -np.inf
        while True:
            now = time.monotonic()
            if again < now and (repeats or again == -np.inf):
                link.bus.publish("planner_scene", scene, run=link.run, process=link.process)
                again = now + REPEAT_S
            left = max(end - now, 0.0)
            item = link.answers.take(min(left, REPEAT_S))
            if isinstance(item, Received):
                try:
                    message = item.message()
                except ValueError as error:
                    # To which question nobody can tell; who says such a thing says it of each.
                    return error
                if not isinstance(message, PlannedMotions) or message.job != scene.job:
                    continue
                if message.question == scene.question:
                    self._stack = item.sender
                    return message
                if message.question < scene.question and item.sender != self._stack:
                    # Whose answers counted was chance.
                    return ValueError("two stacks answer at once; end one of them")
            elif left <= 0.0:
                return None

    def _fall_back(self, rows: Iterable[int], time_s: float, why: str) -> None:
        for row in map(int, rows):
            self.remarks.setdefault(
                row, f"fallback {self._planner.fallback_name!r} acted from {time_s:g} s on: {why}"
            )
