"""A driving stack that a sweep's worker starts, as planner: asked in lock step, in simulated time.

However long it takes for an answer, the future waits; what its answers lag behind is said in
simulated time. Who does not answer within a limit of wall time hangs: its futures fail, and it is
started anew. Whose process dies has its job played again.
"""

from __future__ import annotations

import itertools
import logging
from collections.abc import Callable
from pathlib import Path

import numpy as np

from foretwin.contracts.arrays import Indices
from foretwin.contracts.planner_link import PlannerScene
from foretwin.contracts.setup import StackSetup
from foretwin.sim_worker.planner_interface import (
    Briefing,
    PlannerOutput,
    PlannerView,
    PlayAgain,
    rows_of,
)
from foretwin.sim_worker.planners.answered_motions import AnsweredMotions
from foretwin.sim_worker.planners.hosted import MOST_HUNG_JOBS
from foretwin.sim_worker.planners.scene_message import Asked, scene_message
from foretwin.sim_worker.planners.stack_processes import RUN, StackProcesses, Trouble

ATTEMPTS = 3
"""A job of which so many processes died is played on without them."""

log = logging.getLogger("foretwin.sim_worker.planners")


class StackPlanner:
    """The planner of one name in a sweep's spec."""

    def __init__(
        self,
        name: str,
        setup: StackSetup,
        *,
        folder: Path,
        owner: str,
        leaves: Callable[[], bool] = lambda: False,
    ) -> None:
        """What it prints goes to files in `folder`, named after `owner`, the worker.

        Once that `leaves`, no answer is waited for.
        """
        self.name, self.setup = name, setup
        self.processes = StackProcesses(
            name, setup, folder=folder, owner=owner, says=setup.says, leaves=leaves
        )
        self.deaths = self.hung_jobs = 0
        """Of the present job; in a row."""
        self._jobs = itertools.count()
        self._last: StackDriver | None = None

    def begin_briefed(self, briefing: Briefing) -> StackDriver:
        """Return what drives one job's cars: the same job as the last time, if that was lost."""
        last = self._last
        if last is not None and last.briefing.future_ids != briefing.future_ids:
            self.deaths = 0
            self.hung_jobs = self.hung_jobs if last.hung else 0
        self._last = StackDriver(self, briefing, next(self._jobs))
        return self._last

    def close(self) -> None:
        """End its processes."""
        self.processes.close()


class _Share:
    """The futures of a job that one process drives."""

    def __init__(self, number: int, rows: Indices, briefing: Briefing) -> None:
        self.number, self.rows = number, rows
        count = len(briefing.future_ids)
        self.motions = AnsweredMotions(
            count, rate_hz=briefing.rate_hz, latency_s=briefing.latency_s
        )
        self.questions = 0

    def fail(self, rows: Indices | list[int]) -> None:
        self.rows = np.setdiff1d(self.rows, rows)


class StackDriver:
    """Asks, waits and tracks; a future of which `remarks` tell has failed, and is asked no more.

    `lost` are those of which that says nothing, since the stack's process hung or died.
    """

    def __init__(self, planner: StackPlanner, briefing: Briefing, job: int) -> None:
        self.briefing = briefing
        self.remarks: dict[int, str] = {}
        self.lost: set[int] = set()
        self.hung = False
        self._planner, self._job = planner, job
        count, among = len(briefing.future_ids), planner.setup.instances
        rows = [np.arange(number, count, among) for number in range(among)]
        self._shares = [_Share(n, mine, briefing) for n, mine in enumerate(rows) if len(mine)]
        self._begun = False

    def plan(self, view: PlannerView) -> PlannerOutput:
        """Answer one control tick, with NaN for futures that have failed; raises PlayAgain."""
        if not self._begun:
            self._begun = True
            self._begin()
        due = [one for one in self._shares if len(one.rows) and one.motions.due(view.time_s)]
        if due:
            self._ask(due, view)
        accel, angle = np.full((2, len(view.arc_m)), np.nan)
        for share in self._shares:
            self._fail(share, share.motions.drop_ended(view.time_s))
            rows = share.rows
            if len(rows) == len(accel):
                accel, angle = share.motions.track(view, rows)
            elif len(rows):
                accel[rows], angle[rows] = share.motions.track(rows_of(view, rows), rows)
        return PlannerOutput(accel, angle)

    def _begin(self) -> None:
        planner = self._planner
        if planner.hung_jobs >= MOST_HUNG_JOBS:
            self.hung = True
            words = f"hung in {MOST_HUNG_JOBS} jobs in a row and is asked no more"
            for share in self._shares:
                self._lose(share, words)
            return
        troubles = planner.processes.make_ready()
        for share in self._shares:
            if share.number in troubles:
                self._lose(share, troubles[share.number])

    def _ask(self, due: list[_Share], view: PlannerView) -> None:
        questions = {share.number: self._question(share, view) for share in due}
        outcomes = self._planner.processes.ask(questions)
        for share in due:
            outcome, asked = outcomes[share.number], share.rows
            if isinstance(outcome, Trouble):
                self._take_trouble(share, outcome)
                continue
            try:
                why = share.motions.take(outcome, asked, view.time_s, view.states)
            except (TypeError, ValueError) as error:
                why = dict.fromkeys(map(int, asked), str(error))
            self._fail(share, why)

    def _question(self, share: _Share, view: PlannerView) -> PlannerScene:
        share.motions.asked(view.time_s)
        share.questions += 1
        asked = Asked(
            run_id=RUN,
            worker_id=self._planner.processes.process_id(share.number),
            job=self._job,
            question=share.questions,
            within_s=self._planner.setup.answer_within_s,
            reset=share.questions == 1,
        )
        return scene_message(view, asked, share.rows, self.briefing)

    def _take_trouble(self, share: _Share, trouble: Trouble) -> None:
        planner = self._planner
        if trouble.kind == "nonsense":
            self._fail(share, dict.fromkeys(map(int, share.rows), trouble.words))
            return
        log.warning("planner %r, process %d: %s", planner.name, share.number, trouble.words)
        planner.processes.end(share.number)
        if trouble.kind == "hung":
            if not self.hung:
                planner.hung_jobs += 1
            self.hung = True
            self._lose(share, trouble.words)
            return
        planner.deaths += 1
        if planner.deaths < ATTEMPTS:
            raise PlayAgain(f"planner {planner.name!r}: its process {trouble.words}")
        self._lose(share, f"{ATTEMPTS} of its processes died of the job, the last {trouble.words}")

    def _lose(self, share: _Share, words: str) -> None:
        self.lost.update(map(int, share.rows))
        self._fail(share, dict.fromkeys(map(int, share.rows), words))

    def _fail(self, share: _Share, why: dict[int, str]) -> None:
        if why:
            self.remarks |= why
            share.fail(list(why))
