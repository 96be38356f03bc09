"""Hands over where a live drive stands whenever that changes, to who keeps it for the next one."""

from __future__ import annotations

import math
import time
from collections.abc import Callable

from foretwin.orchestrator.drive.conductor import Conductor
from foretwin.orchestrator.drive.live_loop import LiveLoop
from foretwin.orchestrator.drive.process_watch import ProcessWatch
from foretwin.orchestrator.drive.standing import heard_of, standing_of

HEARD_EVERY_S = 1.0
"""As much is what restarting takes: an estimator that is older by it has missed the same again."""


class HandingOver:
    """Says where a drive stands: in short as rounds and jobs begin and end, all of it at its end.

    What was heard changes with each sample, and takes most of the time, for the estimator is part
    of it: it counts as of a round that fell due within the last second, or as of the last one.
    """

    def __init__(
        self,
        conductor: Conductor,
        watch: ProcessWatch,
        *,
        keep: Callable[[bytes], None],
        mono_s: Callable[[], float] = time.monotonic,
    ) -> None:
        """`keep` takes each standing; lock step begins anew, and keeps none."""
        self._conductor, self._watch, self._keep = conductor, watch, keep
        self._counted: object = None
        self._mono_s = mono_s
        self._heard, self._heard_by_round, self._heard_at_s = b"", -1, -math.inf
        self.loop: LiveLoop | None = None
        """What knows when the next round is due."""

    def news(self) -> None:
        """Hand over where a round or job has begun or ended since."""
        rounds = self._conductor.rounds
        jobs, tally = rounds.dispatcher.dispatch.count, rounds.tally
        counted = tally.due, tally.ended, jobs.given, jobs.results, jobs.refused, jobs.lost
        if counted == self._counted:
            return
        self._counted = counted
        now_s = self._mono_s()
        if self._heard_by_round != tally.due and now_s - self._heard_at_s >= HEARD_EVERY_S:
            self._heard = heard_of(self._conductor)
            self._heard_by_round, self._heard_at_s = tally.due, now_s
        self._hand_over("")

    def all(self, *, exit_word: str = "") -> None:
        """Hand over everything as it is now; `exit_word` where this is the drive's end."""
        if not self._conductor.plan.config.lock_step:
            self._heard = heard_of(self._conductor)
            self._hand_over(exit_word)

    def _hand_over(self, exit_word: str) -> None:
        grid = None if self.loop is None else self.loop.grid
        self._keep(
            standing_of(
                self._conductor, self._watch, grid=grid, heard=self._heard, exit_word=exit_word
            )
        )
