"""Carries tasks to workers over the bus; whoever owns the mailbox hands in what comes back."""

from __future__ import annotations

import math
import time
from collections.abc import Iterable

from foretwin.contracts.bus import Bus, Mailbox, Reply
from foretwin.contracts.runner import Answer, Task
from foretwin.contracts.trace import sent, traced
from foretwin.orchestrator.runner.dispatch import Dispatch, GivenUp

NO_ANSWER = "no answer"
"""What the bus says of a question that nobody answered."""
LONGEST_S = 3600.0
"""So long a question whose task has no limit waits for its answer, where nobody says otherwise."""
_SILENT_S = 0.5
"""So long a worker that left a question unanswered is given nothing: if it has died, it is known
by then, and where its connection was lost and came back, it may answer nothing in between."""


class BusDispatcher:
    """The tasks of a run and its workers, of which it gives to those `expected` alone.

    A task without a limit of its own is asked for again after `longest_s`: Zenoh remembers each
    question for as long as it might wait, answered or not (0.8 kB). See Dispatch.
    """

    def __init__(
        self,
        bus: Bus,
        mailbox: Mailbox,
        *,
        run_id: str,
        expected: Iterable[str],
        in_flight: int = 1,
        longest_s: float = LONGEST_S,
    ) -> None:
        self._longest_s = longest_s
        self.dispatch = Dispatch(in_flight=in_flight)
        self.dispatch.expect(expected)
        self._bus, self._mailbox, self._run_id = bus, mailbox, run_id
        self._allowed: dict[str, tuple[float, float]] = {}
        """Of tasks with a deadline: when it is, and how long that was from their start."""
        self._silent_since_s: dict[str, float] = {}
        self._given_s: dict[tuple[str, str], float] = {}
        """When each task was given to whom."""

    @property
    def workers(self) -> tuple[str, ...]:
        """Ids of the workers that are up."""
        return self.dispatch.workers

    def submit(
        self,
        task: Task,
        *,
        within_s: float | None = None,
        due_s: float | None = None,
        near: bool = False,
    ) -> None:
        """Take a task; one that is not answered `within_s` from now is given up.

        `due_s` (monotonic) and `near` say who may be given it; see Dispatch.
        """
        span_s = 0.0 if due_s is None else due_s - time.monotonic()
        self.dispatch.submit(task, due_s=due_s, span_s=span_s, near=near)
        if within_s is not None:
            self._allowed[task.key] = (time.monotonic() + within_s, within_s)

    def cancel(self, key: str) -> None:
        """Forget a task."""
        self._allowed.pop(key, None)
        self.dispatch.cancel(key)

    def expect(self, worker_ids: Iterable[str]) -> list[Answer]:
        """Give to these workers alone from now on; returns what is given up since they are few."""
        return self._answers(self.dispatch.expect(worker_ids))

    def worker_up(self, worker_id: str) -> list[Answer]:
        """A worker is there; returns what is given up since its earlier life has died of it."""
        self._silent_since_s.pop(worker_id, None)
        return self._answers(self.dispatch.worker_up(worker_id))

    def worker_down(self, worker_id: str, *, how: str = "") -> list[Answer]:
        """A worker is gone; returns what is given up since it has died of it."""
        self._silent_since_s.pop(worker_id, None)
        return self._answers(self.dispatch.worker_down(worker_id, how=how))

    def give_up(self, key: str, reason: str) -> list[Answer]:
        """Try a task no more; returns what that comes to."""
        return self._answers(self.dispatch.give_up(key, reason))

    def without_takers(self, key: str) -> list[Answer]:
        """Give a task up that all workers which are up refused; returns what that comes to."""
        return self._answers(self.dispatch.without_takers(key))

    def close(self) -> None:
        """Forget every task: the run is over."""
        self._allowed.clear()
        self.dispatch.close()

    @traced("give jobs out")
    def give_out(self) -> None:
        """Send waiting tasks to free workers; call it often."""
        now_s = time.monotonic()
        for worker_id, since_s in list(self._silent_since_s.items()):
            if now_s - since_s > _SILENT_S:
                del self._silent_since_s[worker_id]
                self.dispatch.trust(worker_id)
        self.dispatch.take_over(now_s=now_s)
        for worker_id, task in self.dispatch.assignments(now_s=now_s):
            sent(task.channel, task.key)
            self._given_s[worker_id, task.key] = now_s
            until_s, _ = self._allowed.get(task.key, (now_s + self._longest_s, 0.0))
            self._bus.request(
                task.channel,
                task.question,
                self._mailbox,
                tag=(worker_id, task),
                timeout_s=max(until_s - now_s, 0.0) + 0.01,
                run=self._run_id,
                process=worker_id,
            )

    def reply(self, reply: Reply) -> list[Answer]:
        """Take what the bus says of a task; returns what became of the task, nothing if not yet."""
        worker_id, task = reply.tag
        given_s = self._given_s.pop((worker_id, task.key), None)
        if reply.message is not None:
            if given_s is not None:
                received_s = reply.received_mono_ns / 1e9
                self.dispatch.far.took(worker_id, received_s - given_s, now_s=received_s)
            if not self.dispatch.answered(worker_id, task.key):
                return []
            self._allowed.pop(task.key, None)
            return [Answer(task, reply.message, "", worker_id, reply.received_mono_ns)]
        until_s, within_s = self._allowed.get(task.key, (math.inf, 0.0))
        if time.monotonic() >= until_s:
            self.dispatch.unanswered(worker_id, task.key)
            self.dispatch.trust(worker_id)  # It may be slow alone.
            given_up = self.dispatch.give_up(task.key, f"no answer in {within_s:g} s")
        elif reply.error == NO_ANSWER and worker_id in self.dispatch.far:
            # Its link may be back, and its answers not yet: it has to be heard first.
            self.dispatch.take_back(worker_id, task.key)
            self.dispatch.far.answered(worker_id, task.key)
            self.dispatch.far.silent(worker_id)
            return []
        elif reply.error == NO_ANSWER:
            self.dispatch.unanswered(worker_id, task.key)
            self._silent_since_s.setdefault(worker_id, time.monotonic())
            return []
        else:
            reason, now_s = reply.error or "", time.monotonic()
            given_up = self.dispatch.refused(worker_id, task.key, reason, now_s=now_s)
        return self._answers(given_up)

    def _answers(self, given_up: list[GivenUp]) -> list[Answer]:
        for task, _ in given_up:
            self._allowed.pop(task.key, None)
        return [Answer(task, None, reason) for task, reason in given_up]
