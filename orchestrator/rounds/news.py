"""What rounds have to tell the engineer: each thing once, however often it happens."""

from __future__ import annotations

import logging
from collections.abc import Callable, Mapping

from foretwin.orchestrator.instructions import Notice
from foretwin.orchestrator.runner.open_rounds import RoundDone, RoundOrder

log = logging.getLogger("orchestrator")

_FAILURES_TOLD = 16
"""So many different reasons for giving up a round are told; the log has every one."""


class RoundNews:
    """Remembers what was told, and tells by `tell` what is new."""

    def __init__(self, tell: Callable[[Notice], None]) -> None:
        self._tell = tell
        self._planners: set[str] = set()
        self._failures: set[str] = set()
        self._sick: frozenset[str] = frozenset()
        self._slow_told = False

    def given_up(self, order: RoundOrder, reason: str) -> None:
        """Log that a round is given up, and tell each reason once."""
        log.warning("round %d is given up: %s", order.round_id, reason)
        if reason not in self._failures and len(self._failures) < _FAILURES_TOLD:
            self._failures.add(reason)
            self._tell(Notice("error", f"round {order.round_id} is given up: {reason}"))

    def pace(self, short_of: str, *, rate_hz: float) -> None:
        """Tell that the rounds have another pace: `short_of` of what was asked for, or all."""
        if not short_of:
            self._tell(Notice("info", "the machine keeps up: all futures in every round again"))
            return
        text = f"{short_of} from now on: the machine is too slow for all at {rate_hz:g} Hz"
        self._tell(Notice("info" if self._slow_told else "warning", text))
        self._slow_told = True

    def health(self, sick: Mapping[str, str]) -> None:
        """Tell who newly is sick, with the reason, and who is well again."""
        for worker_id in sorted(sick.keys() - self._sick):
            text = f"{worker_id} is sick, it refuses jobs: {sick[worker_id]}; others are asked"
            self._tell(Notice("warning", text))
        for worker_id in sorted(self._sick - sick.keys()):
            self._tell(Notice("info", f"{worker_id} is given jobs again"))
        self._sick = frozenset(sick)

    def planners(self, done: RoundDone) -> None:
        """Say once of each planner that it failed, or that another one had to act for it."""
        planners = iter(future.planner for future in done.order.futures)
        for result in done.results:
            failures, remarks = result.outcome.failures, result.outcome.remarks
            for place, planner in zip(range(len(result.future_indices)), planners, strict=False):
                words = (failures[place] if failures else "") or (remarks[place] if remarks else "")
                if words and planner not in self._planners:
                    self._planners.add(planner)
                    self._tell(Notice("warning", f"a future driven by {planner}: {words}"))
