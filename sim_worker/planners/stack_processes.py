"""The processes of a driving stack that a sweep's worker starts: asked over a bus of their own."""

from __future__ import annotations

import contextlib
import secrets
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Literal, NamedTuple

import msgspec

from foretwin.contracts.access import BusMember
from foretwin.contracts.bus import Mailbox, Received, ZenohBus
from foretwin.contracts.errors import one_line
from foretwin.contracts.guard import Refused
from foretwin.contracts.local_bus import make_local_bus, private_files
from foretwin.contracts.owned_folder import make_temporary
from foretwin.contracts.planner_link import (
    PlannedMotions,
    PlannerJoined,
    PlannerScene,
    other_link,
)
from foretwin.contracts.planner_serving import LINK_GIVEN, GivenLink
from foretwin.contracts.setup import StackSetup
from foretwin.sim_worker.planners.kept_program import KeptProgram

RUN = "stack"
MOST_FAILED_STARTS = 3
"""A process that ended so often in a row before it joined is not started any more."""
_MEMBER = BusMember("planner", "planner")
_LOOK_S = 0.05
_REPEAT_S = 1.0
"""The first question of a process is repeated, should it have come before anybody listened."""


class Trouble(NamedTuple):
    """Why there is no answer, in words."""

    kind: Literal["hung", "died", "nonsense", "unusable"]
    words: str


@dataclass(slots=True)
class _Instance:
    """One of a stack's processes, and what is known of its present life."""

    number: int
    log: Path
    lives: int = 0
    process: KeptProgram | None = None
    joined: bool = False
    asked: bool = False
    failed_starts: int = 0
    unusable: str = ""
    """Why it is of no use for good."""


class StackProcesses:
    """The processes of one stack, started as they are needed; what they print goes to the files
    `FOLDER/OWNER-NAME-NUMBER.log`.

    `says` is the name and version by which the stack joined before: as another it is refused. Once
    `leaves` says so, nothing is waited for any more. Use `close`, or the end of this process, to
    end all of them.
    """

    def __init__(
        self,
        name: str,
        setup: StackSetup,
        *,
        folder: Path,
        owner: str,
        says: PlannerJoined | None = None,
        leaves: Callable[[], bool] = lambda: False,
    ) -> None:
        self._leaves = leaves
        self._name, self._setup, self._says = name, setup, says
        self._instances = [
            _Instance(number, folder / f"{owner}-{name}-{number}.log")
            for number in range(setup.instances)
        ]
        self._mailbox = Mailbox(16 + 4 * setup.instances)
        self._held = contextlib.ExitStack()
        self._bus: ZenohBus | None = None
        self.said: PlannerJoined | None = None
        """Who joined last."""

    def _open(self) -> None:
        """Open the bus, on which whoever has been started has the role of a planner."""
        if self._bus is not None:
            return
        temporary = make_temporary("foretwin-stack-")
        self._held.callback(temporary.remove)
        self._local = make_local_bus(
            f"stack-{secrets.token_hex(4)}",
            [_MEMBER],
            run_id=RUN,
            lossless=True,
            instead=temporary.path,
        )
        self._held.callback(self._local.remove)
        with private_files():
            bus = ZenohBus(self._local.router, router=True)
        self._held.callback(bus.close)
        for channel in ("planner_joined", "planned_motions"):
            bus.subscribe(channel, self._mailbox, run=RUN, process="*")
        self._bus = bus

    @property
    def pids(self) -> list[int]:
        """The operating system's ids of the processes that hold the stack's."""
        return [one.process.pid for one in self._instances if one.process is not None]

    def close(self) -> None:
        """End all of them, and the bus."""
        for one in self._instances:
            if one.process is not None:
                one.process.tell_to_end()
        for one in self._instances:
            self.end(one.number)
        self._held.close()

    def process_id(self, number: int) -> str:
        """Return by what the present life of a process is told apart from its earlier ones."""
        return f"{self._name}-{number}-{self._instances[number].lives}"

    def make_ready(self) -> dict[int, str]:
        """Start those that do not run, and wait until they have joined; returns which of them are
        of no use, and why."""
        for one in self._instances:
            if one.process is not None and one.process.has_ended:
                self.end(one.number)
            if one.process is None and not one.unusable:
                try:
                    self._start(one)
                except OSError as error:
                    one.unusable = f"cannot be started: {one_line(error)}"
        end = time.monotonic() + self._setup.start_within_s
        troubles: dict[int, str] = {}
        while waits := [
            one
            for one in self._instances
            if not (one.joined or one.unusable or one.number in troubles)
        ]:
            self._stay()
            if self._hear(_LOOK_S) is not None and time.monotonic() <= end:
                continue
            for one in waits:
                assert one.process is not None
                if one.process.has_ended:
                    troubles[one.number] = f"{one.process.ending()} before it joined"
                elif time.monotonic() > end:
                    within = f"{self._setup.start_within_s:g} s"
                    troubles[one.number] = f"did not join within {within} and was ended"
                if one.number in troubles:
                    self._failed_to_start(one, troubles[one.number])
        for one in self._instances:
            if one.unusable:
                self.end(one.number)
        return troubles | {one.number: one.unusable for one in self._instances if one.unusable}

    def ask(self, questions: dict[int, PlannerScene]) -> dict[int, PlannedMotions | Trouble]:
        """Ask processes that are ready, by their numbers, and return what each comes to."""
        within_s = self._setup.answer_within_s
        for number in questions:
            self._publish(questions[number])
        end = time.monotonic() + within_s
        again = time.monotonic() + _REPEAT_S
        outcomes: dict[int, PlannedMotions | Trouble] = {}
        beside: dict[int, PlannedMotions] = {}
        while waits := questions.keys() - outcomes.keys():
            self._stay()
            heard = self._hear(_LOOK_S)
            if heard is not None:
                number, said = heard
                if number in waits and _answers(said, questions[number]):
                    self._instances[number].asked = True
                    outcomes[number] = said
                elif isinstance(said, PlannedMotions):
                    beside[number] = said
            now = time.monotonic()
            if heard is not None and now <= end:
                continue  # Who talks on and on has no more time than who says nothing.
            waits = questions.keys() - outcomes.keys()
            for one in [self._instances[number] for number in waits]:
                assert one.process is not None
                if one.process.has_ended:
                    outcomes[one.number] = Trouble("died", one.process.ending())
                elif now > end:
                    words = f"gave no answer within {within_s:g} s of wall time and was ended"
                    words += _said_beside(beside.get(one.number), questions[one.number])
                    outcomes[one.number] = Trouble("hung", words)
                elif now > again and not one.asked:
                    self._publish(questions[one.number])
            again = max(again, now + _REPEAT_S) if now > again else again
        return outcomes

    def _stay(self) -> None:
        if self._leaves():
            raise RuntimeError("the worker leaves; its driving stacks are waited for no more")

    def end(self, number: int) -> None:
        """End one of the processes, and whatever it has started; the next one is another life."""
        one = self._instances[number]
        process, one.process, one.joined = one.process, None, False
        if process is not None:
            process.end()

    def _start(self, one: _Instance) -> None:
        self._open()
        one.lives += 1
        one.joined = one.asked = False
        given = GivenLink(
            bus=self._local.setup_of(_MEMBER.name),
            run_id=RUN,
            process_id=self.process_id(one.number),
        )
        one.process = KeptProgram(
            self._setup.command,
            folder=self._setup.folder,
            log=one.log,
            told={LINK_GIVEN: msgspec.json.encode(given).decode()},
        )

    def _publish(self, scene: PlannerScene) -> None:
        assert self._bus is not None
        self._bus.publish("planner_scene", scene, run=RUN, process=scene.worker_id)

    def _hear(self, timeout_s: float) -> tuple[int, PlannedMotions | Trouble] | None:
        """Take one message; returns whose it is and what it says, None where none came in time or
        it is of an earlier life."""
        item = self._mailbox.take(timeout_s)
        if not isinstance(item, Received):
            return None
        process_id = item.key.rsplit("/", 2)[1]
        one = next((x for x in self._instances if self.process_id(x.number) == process_id), None)
        if one is None:
            return None
        try:
            message = item.message()
        except Refused as refused:
            return one.number, Trouble("nonsense", f"answers what is no answer: {refused}")
        if isinstance(message, PlannerJoined):
            self._take_joined(one, message)
            return None
        return one.number, message

    def _take_joined(self, one: _Instance, who: PlannerJoined) -> None:
        one.joined, one.failed_starts, self.said = True, 0, who
        if wrong := other_link(who.link):
            one.unusable = wrong
        elif self._says is not None and (who.name, who.version) != (
            self._says.name,
            self._says.version,
        ):
            one.unusable = (
                f"it says that it is {who.name} {who.version}; when the sweep began it was "
                f"{self._says.name} {self._says.version}"
            )

    def _failed_to_start(self, one: _Instance, words: str) -> None:
        self.end(one.number)
        one.failed_starts += 1
        if one.failed_starts >= MOST_FAILED_STARTS:
            one.unusable = f"{words}, {MOST_FAILED_STARTS} times: it is not started any more"


def _answers(said: PlannedMotions | Trouble, question: PlannerScene) -> bool:
    """Whether what a process said ends a question: an answer to it, or nonsense."""
    if isinstance(said, Trouble):
        return True
    return (said.job, said.question) == (question.job, question.question)


def _said_beside(said: PlannedMotions | None, question: PlannerScene) -> str:
    """Return the end of a sentence on who did not answer: what it answered instead, if anything."""
    if said is None:
        return ""
    return (
        f"; it answered question {said.question} of job {said.job} where question "
        f"{question.question} of job {question.job} was asked"
    )
