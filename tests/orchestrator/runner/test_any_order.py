"""Whatever workers do, in any order: every task ends once, and nobody idles while one waits."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable

from hypothesis import settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, initialize, invariant, precondition, rule

from foretwin.contracts.runner import Task
from foretwin.contracts.simulation import PrepareRequest
from foretwin.orchestrator.runner.dispatch import Dispatch, GivenUp
from foretwin.orchestrator.runner.sickness import LONGEST_PAUSE_S

NAMES = ("w0", "w1", "w2")
workers = st.sampled_from(NAMES)
places = st.integers(0, 99)


class AnyOrder(RuleBasedStateMachine):
    """Workers that answer, refuse, die, fall silent, and answer for an earlier life."""

    @initialize(in_flight=st.sampled_from([1, 2]))
    def begin(self, in_flight: int) -> None:
        self.dispatch = Dispatch(in_flight=in_flight)
        self.dispatch.expect(NAMES)
        self.now_s = 0.0
        self.submitted: list[str] = []
        self.ended: Counter[str] = Counter()
        self.held: dict[str, list[str]] = {}
        """What each worker that is up was asked and has not answered."""
        self.stale: list[tuple[str, str]] = []
        """Questions to lives that are over, or that were answered: any may be answered (again)."""
        self.refused: set[tuple[str, str]] = set()
        for name in NAMES:
            self.up(name)
        for world in "AABBAB":
            self.submit(world)

    def open(self) -> list[str]:
        return [key for key in self.submitted if not self.ended[key]]

    def at_work(self) -> list[str]:
        return [key for keys in self.held.values() for key in keys]

    def end(self, given_up: Iterable[GivenUp]) -> None:
        self.ended.update(one.task.key for one in given_up)

    def give_out(self) -> None:
        for worker_id, task in self.dispatch.assignments(now_s=self.now_s):
            assert (worker_id, task.key) not in self.refused
            assert not self.ended[task.key]
            assert task.key not in self.at_work()
            self.held[worker_id].append(task.key)

    @rule(world=st.sampled_from("AB"))
    def submit(self, world: str) -> None:
        key = str(len(self.submitted))
        self.submitted.append(key)
        self.dispatch.submit(Task(key, "job", world, PrepareRequest(world_id=world)))
        self.give_out()

    @rule(name=workers)
    def up(self, name: str) -> None:
        self.stale += [(name, key) for key in self.held.get(name, [])]
        self.held[name] = []
        self.end(self.dispatch.worker_up(name))
        self.give_out()

    @rule(name=workers)
    def down(self, name: str) -> None:
        self.stale += [(name, key) for key in self.held.pop(name, [])]
        self.end(self.dispatch.worker_down(name, how="signal 9"))
        self.give_out()

    @rule()
    def stranger_up(self) -> None:
        self.end(self.dispatch.worker_up("x"))
        assert "x" not in self.dispatch.workers
        self.give_out()

    def _take(self, name: str, key: str) -> None:
        if key in self.held.get(name, []):
            self.held[name].remove(key)

    @rule(name=workers)
    def answer(self, name: str) -> None:
        if self.held.get(name):
            self._reply(name, self.held[name][0], refuses=False)

    @rule(name=workers)
    def refuse(self, name: str) -> None:
        if self.held.get(name):
            self._reply(name, self.held[name][0], refuses=True)

    @precondition(lambda self: self.refused)
    @rule(place=places)
    def refuse_what_another_refused(self, place: int) -> None:
        known = {key for _, key in self.refused}
        at = [(name, key) for name, keys in self.held.items() for key in keys if key in known]
        if at:
            name, key = at[place % len(at)]
            self._reply(name, key, refuses=True)

    @precondition(lambda self: self.stale)
    @rule(place=places, refuses=st.booleans())
    def reply_late_or_twice(self, place: int, refuses: bool) -> None:
        name, key = self.stale[place % len(self.stale)]
        self._reply(name, key, refuses=refuses)

    def _reply(self, name: str, key: str, *, refuses: bool) -> None:
        self._take(name, key)
        self.stale.append((name, key))
        late = self.dispatch.late
        if refuses:
            self.refused.add((name, key))
            self.end(self.dispatch.refused(name, key, "no", now_s=self.now_s))
        elif self.dispatch.answered(name, key):
            self.ended[key] += 1
        else:
            assert self.ended[key]
            assert self.dispatch.late == late + 1
        self.give_out()

    @rule(name=workers, comes_back=st.booleans())
    def falls_silent(self, name: str, comes_back: bool) -> None:
        if self.held.get(name):
            key = self.held[name][-1]
            self.dispatch.unanswered(name, key)
            self.give_out()
            if comes_back:
                self._take(name, key)
                self.dispatch.trust(name)
            else:
                self.down(name)
            self.give_out()

    @rule(place=places)
    def cancel(self, place: int) -> None:
        if open_ := self.open():
            key = open_[place % len(open_)]
            self.dispatch.cancel(key)
            self.ended[key] += 1
            self.give_out()

    @rule(place=places)
    def deadline(self, place: int) -> None:
        if open_ := self.open():
            key = open_[place % len(open_)]
            self.end(self.dispatch.without_takers(key))
            self.end(self.dispatch.give_up(key, "no answer in time"))
            self.give_out()

    @rule(seconds=st.sampled_from([0.5, 2.0, LONGEST_PAUSE_S]))
    def time_passes(self, seconds: float) -> None:
        self.now_s += seconds
        self.give_out()

    @invariant()
    def every_task_is_open_or_ended_once(self) -> None:
        if not hasattr(self, "dispatch"):
            return
        count = self.dispatch.count
        assert max(self.ended.values(), default=0) <= 1
        assert self.dispatch.open == len(self.open())
        assert count.given == len(self.submitted)
        assert count.given == count.results + count.refused + count.lost + self.dispatch.open

    @invariant()
    def no_healthy_worker_idles_while_it_could_do_what_waits(self) -> None:
        if not hasattr(self, "dispatch"):
            return
        held = self.at_work()
        waiting = [key for key in self.open() if key not in held]
        for name in self.held.keys() - self.dispatch.sickness.sick.keys():
            if not self.held[name]:
                assert [key for key in waiting if (name, key) not in self.refused] == []

    def teardown(self) -> None:
        if not hasattr(self, "dispatch"):
            return
        for name in NAMES:
            self.up(name)
        for _ in range(4 * len(self.submitted)):
            self.time_passes(LONGEST_PAUSE_S)
            for name in NAMES:
                self.answer(name)
        self.every_task_is_open_or_ended_once()
        assert self.open() == []


TestAnyOrder = AnyOrder.TestCase
TestAnyOrder.settings = settings(max_examples=150, stateful_step_count=40, deadline=None)
