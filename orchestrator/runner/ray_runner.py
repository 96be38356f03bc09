"""A runner whose workers are seats on Ray: Ray says which task is played where, and when again.

All that it is given goes to Ray at once, each task with its World as an argument: Ray plays tasks
with the same argument one after another in the same process as long as there are such, and
prefers nodes that hold it.
"""

from __future__ import annotations

import contextlib
import itertools
import time
from collections import OrderedDict, deque
from collections.abc import Callable, Collection
from concurrent.futures import Future
from dataclasses import dataclass, field
from queue import Empty, SimpleQueue
from typing import Any, NamedTuple, Protocol

from foretwin.contracts.codec import encode
from foretwin.contracts.errors import UserError, one_line
from foretwin.contracts.guard import Refused, opened
from foretwin.contracts.keys import CHANNELS
from foretwin.contracts.runner import Answer, Task, TaskCount
from foretwin.orchestrator.runner.dispatch import ATTEMPTS
from foretwin.orchestrator.runner.worker_processes import NoWorkerError
from foretwin.sim_worker.seat import SeatAnswer, SeatQuestion

_ON_A_WORLD = "job", "place"
"""What is asked about a World that is there."""
_KEPT_WORLDS = 8
"""So many Worlds stay in the object store after the last question about them."""
_REMEMBERED = 1024
_LOOK_S = 1.0
_AGAIN_S = 5.0
"""Of a node that is killed Ray knows by then, and plays its tasks again. Of one whose power or link
is cut it waits for an answer for minutes, though it knows that the node is gone."""


class Ended(NamedTuple):
    """The end of a question: an answer, or in words what became of whom it was given to."""

    answer: SeatAnswer | None
    trouble: str = ""
    node: str = ""
    """Where the answer is from."""


class SeatCluster(Protocol):
    """What a runner needs of Ray."""

    def seats(self) -> tuple[str, ...]:
        """Return a name for each processor that there is now."""

    @property
    def lost_s(self) -> float:
        """When a processor was last found to be gone, by the monotonic clock; -inf: never."""

    def put(self, data: bytes) -> Any:
        """Store bytes for whoever is asked; gone with the last reference to what is returned."""

    def ask(
        self, question: SeatQuestion, world: Any | None, *, away_from: Collection[str] = ()
    ) -> Future[Ended]:
        """Have a question answered by any seat, on no node of these where there are others; again
        where that dies."""

    def forget(self, asked: Future[Ended]) -> None:
        """Let a question that was not begun not be begun any more."""


@dataclass(slots=True, eq=False)
class _AtSeats:
    """A task that was given to the cluster, once or, after a node was lost, twice."""

    task: Task
    since_s: float
    futures: list[Future[Ended]] = field(default_factory=list)
    """Those that have not ended yet."""
    asked_again: bool = False


class _EndOfOne(NamedTuple):
    of: _AtSeats
    future: Future[Ended]


class RayRunner:
    """Has tasks answered by seats on a cluster; see Runner.

    `world_file` gives the bytes of a World. `most` bounds how many tasks are with Ray at once, None
    leaves it to the cluster. A seat gives an answer up after `task_timeout_s`.
    """

    def __init__(
        self,
        cluster: SeatCluster,
        *,
        world_file: Callable[[str], bytes],
        task_timeout_s: float,
        most: int | None = None,
        log: Callable[[bytes], None] = lambda _: None,
    ) -> None:
        self._cluster, self._world_file, self._log = cluster, world_file, log
        self._timeout_s, self._most = task_timeout_s, most
        self._open: dict[str, _AtSeats | None] = {}
        self._waiting: deque[Task] = deque()
        self._ended: SimpleQueue[_EndOfOne] = SimpleQueue()
        self._answers: deque[Answer] = deque()
        self._worlds: OrderedDict[str, Any] = OrderedDict()
        self._asked_of: dict[str, int] = {}
        """How many open questions there are about each World that is stored."""
        self._answered_on: OrderedDict[str, set[str]] = OrderedDict()
        """Which nodes have answered the last tasks: who asks again wants another's word."""
        self._count = TaskCount()
        self._heard_s = time.monotonic()
        self._next_look_s = 0.0

    @property
    def capacity(self) -> int:
        """How many tasks can be in work at once: one for each processor of the cluster."""
        seats = len(self._cluster.seats())
        return max(seats if self._most is None else min(seats, self._most), 1)

    @property
    def workers(self) -> tuple[str, ...]:
        """Names of the processors that are there now."""
        return self._cluster.seats()

    @property
    def count(self) -> TaskCount:
        """What became of the tasks submitted so far."""
        return self._count

    def submit(self, task: Task) -> None:
        """Take a task; raises ValueError for one whose key is open already."""
        if task.key in self._open:
            raise ValueError(f"task {task.key} is submitted twice")
        if not self._open:
            self._heard_s = time.monotonic()
        self._open[task.key] = None
        self._count.given += 1
        self._waiting.append(task)
        self._give_out()

    def cancel(self, key: str) -> None:
        """Forget a task; see Runner."""
        if key not in self._open:
            return
        asked = self._open.pop(key)
        self._count.lost += 1
        if asked is None:
            self._waiting = deque(task for task in self._waiting if task.key != key)
        else:
            self._leave_world(asked.task)
            for future in asked.futures:
                self._cluster.forget(future)
        self._give_out()

    def take(self, timeout_s: float | None = 0.0) -> Answer | None:
        """Return one answer; see Runner.

        Raises UserError where a node has other versions, NoWorkerError where none answers any more.
        """
        until_s = None if timeout_s is None else time.monotonic() + timeout_s
        while not self._answers:
            if not self._open:
                return None
            left_s = _LOOK_S if until_s is None else min(_LOOK_S, until_s - time.monotonic())
            if time.monotonic() >= self._next_look_s:
                self._look()
            try:
                end = self._ended.get(timeout=max(left_s, 0.0))
            except Empty:
                if until_s is not None and time.monotonic() >= until_s:
                    return None
            else:
                self._take_end(end)
        return self._answers.popleft()

    def _give_out(self) -> None:
        at_work = len(self._open) - len(self._waiting)
        while self._waiting and (self._most is None or at_work < self._most):
            task = self._waiting.popleft()
            asked = _AtSeats(task, time.monotonic())
            try:
                self._ask(asked)
            except OSError as error:
                del self._open[task.key]
                self._count.refused += 1
                self._answers.append(_given_up(task, one_line(error)))
                continue
            self._open[task.key] = asked
            self._asked_of[task.world_id] = self._asked_of.get(task.world_id, 0) + 1
            at_work += 1

    def _ask(self, asked: _AtSeats) -> None:
        """Give a task to the cluster; raises OSError where its World cannot be read."""
        task, world = asked.task, self._world_of(asked.task)
        question = SeatQuestion(task.channel, task.world_id, encode(task.question))
        before = self._answered_on.get(task.key, ())
        future = self._cluster.ask(question, world, away_from=before)
        asked.futures.append(future)
        # By a thread of Ray's: the rest is for who takes.
        future.add_done_callback(lambda done: self._ended.put(_EndOfOne(asked, done)))

    def _world_of(self, task: Task) -> Any | None:
        """Return the World of a task in the object store."""
        if task.channel not in _ON_A_WORLD:
            return None
        name = task.world_id
        if name not in self._worlds:
            self._worlds[name] = self._cluster.put(self._world_file(name))
        self._worlds.move_to_end(name)
        return self._worlds[name]

    def _leave_world(self, task: Task) -> None:
        self._asked_of[task.world_id] -= 1
        idle = [name for name in self._worlds if not self._asked_of.get(name)]
        for name in idle[: max(len(idle) - _KEPT_WORLDS, 0)]:
            del self._worlds[name]
            self._asked_of.pop(name, None)

    def _take_end(self, end: _EndOfOne) -> None:
        self._heard_s = time.monotonic()
        task = end.of.task
        if self._open.get(task.key) is not end.of:
            return  # It was cancelled, or its other half was sooner.
        end.of.futures.remove(end.future)
        answer, trouble, node = end.future.result()
        if answer is None and end.of.futures:
            return  # The other half may be answered yet.
        del self._open[task.key]
        self._leave_world(task)
        if answer is None:
            self._count.lost += 1
            self._answers.append(_given_up(task, trouble))
        else:
            self._answered_on.setdefault(task.key, set()).add(node)
            while len(self._answered_on) > _REMEMBERED:
                self._answered_on.popitem(last=False)
            self._take_answer(task, answer)
        self._give_out()

    def _take_answer(self, task: Task, answer: SeatAnswer) -> None:
        for line in answer.log:
            self._log(line)
        if answer.strange:
            raise UserError(f"--engine ray: {answer.strange}: install there what is installed here")
        if answer.late:
            self._count.lost += 1
            self._answers.append(_given_up(task, answer.refusal, answer.seat))
            return
        failure, message, garbled = answer.refusal, None, False
        if not failure:
            reply = CHANNELS[task.channel].reply
            assert reply is not None
            try:
                where = f"{task.channel} of {answer.seat}"
                message = opened(answer.data, reply, where=where).message
            except Refused as refused:
                failure, garbled = one_line(refused), True
        if message is None:
            self._count.refused += 1
            self._answers.append(_given_up(task, failure, answer.seat)._replace(garbled=garbled))
            return
        self._count.results += 1
        self._answers.append(Answer(task, message, "", answer.seat, time.monotonic_ns()))

    def _look(self) -> None:
        """See that somebody can still answer: Ray itself waits for ever."""
        now_s = time.monotonic()
        self._next_look_s = now_s + _LOOK_S
        self._ask_again(now_s)
        silent_s = now_s - self._heard_s
        if silent_s > self._timeout_s and not self._cluster.seats():
            raise NoWorkerError(f"the Ray cluster has had no processor for {self._timeout_s:g} s")
        most_s = (ATTEMPTS + 1) * self._timeout_s
        if silent_s > most_s:
            raise NoWorkerError(f"no node of the Ray cluster has answered anything in {most_s:g} s")

    def _ask_again(self, now_s: float) -> None:
        """Ask once more what a node that is gone may have: the eldest, as many as can be in work.

        What is answered twice counts once.
        """
        can_be_in_work = self.capacity
        lost_s = self._cluster.lost_s
        if now_s - lost_s < _AGAIN_S:
            return
        given = (asked for asked in self._open.values() if asked is not None)
        for asked in itertools.islice(given, can_be_in_work):
            if asked.since_s < lost_s and not asked.asked_again:
                with contextlib.suppress(OSError):
                    self._ask(asked)
                    asked.asked_again = True


def _given_up(task: Task, why: str, seat: str = "") -> Answer:
    return Answer(task, None, why, seat, time.monotonic_ns())
