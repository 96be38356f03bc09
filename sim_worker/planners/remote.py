"""A driving stack in another process, over the bus, in lock step.

Each 0.1 s of a future the stack is shown where everybody is and has until a deadline to say where
it would drive; cars track that. Where it says nothing of use, a named planner acts instead and the
future is marked.
"""

from __future__ import annotations

import itertools
import time
from typing import NamedTuple

import numpy as np

from foretwin.contracts.arrays import Array, Flags, Indices
from foretwin.contracts.bus import Bus, Mailbox, Received
from foretwin.contracts.planner_link import PlannedMotions, PlannerScene
from foretwin.sim_worker.planner_interface import Planner, PlannerOutput, PlannerView, rows_of
from foretwin.sim_worker.planners.hosted import ANSWER_S, FIRST_ANSWER_S
from foretwin.sim_worker.planners.pure_pursuit_idm import PurePursuitIdm
from foretwin.sim_worker.planners.trajectory_tracking import Trajectories, check_trajectories, track

ASK_EVERY_S = 0.1
_REPEAT_S = 0.25
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
    ) -> None:
        self.fallback = PurePursuitIdm() if fallback is None else fallback
        self.fallback_name = fallback_name
        self.first_answer_s, self.answer_s = first_answer_s, answer_s
        self._connection: _Connection | None = None
        self._jobs = itertools.count()

    def connect(self, bus: Bus, *, run: str, process: str) -> None:
        """Ask over `bus` as the worker `process` of a run."""
        answers = Mailbox(16)
        bus.subscribe("planned_motions", answers, run=run, process=process)
        self._connection = _Connection(bus, run, process, answers)

    def begin(self, count: int) -> RemoteDriver:
        """Return what drives one job's cars."""
        return RemoteDriver(self, self._connection, next(self._jobs), count)

    def plan(self, view: PlannerView) -> PlannerOutput:
        """Answer one control tick as the first of a job."""
        return self.begin(len(view.arc_m)).plan(view)


class RemoteDriver:
    """Asks, waits, and tracks what came; `remarks` say where the fallback had to act."""

    def __init__(
        self, planner: RemotePlanner, connection: _Connection | None, job: int, count: int
    ) -> None:
        self._planner, self._connection, self._job = planner, connection, job
        self.remarks: dict[int, str] = {}
        self._question, self._misses = 0, 0
        self._asked_s = -np.inf
        self._motions = _Motions(count)

    def plan(self, view: PlannerView) -> PlannerOutput:
        """Answer one control tick; raises ValueError where there is no bus to ask over."""
        if self._connection is None:
            raise ValueError("planner 'remote' asks over the bus of a run; there is none here")
        if view.time_s > self._asked_s + ASK_EVERY_S - 1e-6:
            self._asked_s = view.time_s
            self._ask(view, self._connection)
        known = self._motions.known
        if known.all():
            return self._motions.track(view)
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
        within_s = self._planner.first_answer_s if first else self._planner.answer_s
        scene = _scene(view, link, self._job, self._question, within_s)
        waits_s = within_s if self._misses < _PATIENCE else 0.0
        answer = self._answer(scene, link, waits_s, repeats=first)
        if answer is None:
            self._misses += 1
            self._motions.forget()
            self._fall_back(range(len(view.arc_m)), view.time_s, f"no answer within {within_s:g} s")
            return
        self._misses = 0
        try:
            missing = self._motions.take(answer, view.time_s)
        except ValueError as error:
            self._motions.forget()
            self._fall_back(range(len(view.arc_m)), view.time_s, f"no use: {error}")
            return
        self._fall_back(missing, view.time_s, "the answer left it out")

    def _answer(
        self, scene: PlannerScene, link: _Connection, within_s: float, *, repeats: bool
    ) -> PlannedMotions | None:
        """Return the answer to this very question, or None at the deadline."""
        end = time.monotonic() + within_s
        again = -np.inf
        while True:
            now = time.monotonic()
            if again < now and (repeats or again == -np.inf):
                link.bus.publish("planner_scene", scene, run=link.run, process=link.process)
                again = now + _REPEAT_S
            left = max(end - now, 0.0)
            item = link.answers.take(min(left, _REPEAT_S))
            if isinstance(item, Received):
                try:
                    message = item.message()
                except ValueError:
                    message = None
                asked = (scene.job, scene.question)
                if isinstance(message, PlannedMotions) and (message.job, message.question) == asked:
                    return message
            elif left <= 0.0:
                return None

    def _fall_back(self, rows: range | list[int], time_s: float, why: str) -> None:
        for row in rows:
            self.remarks.setdefault(
                row, f"fallback {self._planner.fallback_name!r} acted from {time_s:g} s on: {why}"
            )


class _Motions:
    """The motions received last, by row."""

    def __init__(self, count: int) -> None:
        self.known: Flags = np.zeros(count, dtype=bool)
        self._received: Trajectories | None = None
        self._place = np.zeros(count, dtype=np.intp)

    def forget(self) -> None:
        self.known[:] = False

    def take(self, answer: PlannedMotions, asked_s: float) -> list[int]:
        """Keep an answer; returns the rows it leaves out. Raises ValueError for one of no use."""
        count = len(self.known)
        rows = np.asarray(answer.futures, dtype=np.intp)
        if len(rows) and (rows.min() < 0 or rows.max() >= count or len(set(rows)) < len(rows)):
            raise ValueError(f"futures {answer.futures} of a job with {count}")
        time_s = np.broadcast_to(answer.time_s, (len(rows), *np.shape(answer.time_s)))
        received = Trajectories(time_s + asked_s, answer.xy_m, answer.yaw_rad, answer.speed_mps)
        if len(rows):
            check_trajectories(received)
        self._received = received
        self.known[:] = False
        self.known[rows] = True
        self._place[rows] = np.arange(len(rows))
        return [int(row) for row in np.flatnonzero(~self.known)]

    def track(self, view: PlannerView, rows: Indices | slice = slice(None)) -> PlannerOutput:
        assert self._received is not None
        place = self._place[rows]
        mine = Trajectories._make(values[place] for values in self._received)
        return track(view, mine, time_s=view.time_s)


def _scene(
    view: PlannerView, link: _Connection, job: int, question: int, within_s: float
) -> PlannerScene:
    count, vehicle, path = len(view.arc_m), view.vehicle, view.path
    inside = (path.arc_m >= 0.0) & (path.arc_m <= path.length_m + 1e-6)
    stop = np.full(count, np.inf) if view.stop_arc_m is None else view.stop_arc_m
    return PlannerScene(
        run_id=link.run,
        worker_id=link.process,
        job=job,
        question=question,
        futures=tuple(range(count)),
        time_s=view.time_s,
        answer_within_s=within_s,
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
    )


def _road_users(view: PlannerView) -> Array:
    users = view.users
    if users is None:
        return np.zeros((len(view.arc_m), 0, 7))
    found = np.concatenate(
        [users.poses, users.speed_mps[..., None], users.size_m, users.walks[..., None]], axis=2
    )
    return np.where(np.isnan(users.poses[..., :1]), np.nan, found)
