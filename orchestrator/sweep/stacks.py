"""Driving stacks of somebody else that a sweep starts: their tables in its spec, what they are."""

from __future__ import annotations

import shlex
from collections.abc import Iterator, Mapping
from pathlib import Path

import msgspec

from foretwin.contracts.errors import UserError
from foretwin.contracts.futures import PlannerTiming
from foretwin.contracts.guard import is_identifier
from foretwin.contracts.owned_folder import temporary_folder
from foretwin.contracts.planner_link import MOST_TOOK_S, PlannerJoined
from foretwin.contracts.setup import StackSetup
from foretwin.sim_worker.planners.registry import planner_names
from foretwin.sim_worker.planners.stack_processes import StackProcesses

FUTURES_PER_JOB = 64
MOST_INSTANCES = FUTURES_PER_JOB
_TIMING, _STACK = PlannerTiming(), StackSetup(command=())


class RemoteStack(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """A stack under test; each worker starts it for itself, where the sweep was started."""

    command: str
    """As it would be typed, but that no shell reads it."""
    instances: int = 1
    """So many processes for each worker, which share the futures of a job."""
    stateful: bool = False
    """Whether it remembers from tick to tick: each process drives one future at a time then, from
    its reset to its end. Else one is shown all futures that it shares at once."""
    rate_hz: float = _TIMING.rate_hz
    """How often it is asked, in simulated time."""
    latency_s: float = _TIMING.latency_s
    """So long after what they answer its answers count, in simulated time."""
    answer_within_s: float = _STACK.answer_within_s
    """Of wall time: who takes longer for an answer hangs."""
    start_within_s: float = _STACK.start_within_s
    """Of wall time: who takes longer to be there is not."""

    @property
    def timing(self) -> PlannerTiming:
        """Return when it is asked and its answers count, in simulated time."""
        return PlannerTiming(rate_hz=self.rate_hz, latency_s=self.latency_s)

    @property
    def futures_per_job(self) -> int:
        """Return how many futures are played side by side at most."""
        return self.instances if self.stateful else FUTURES_PER_JOB

    def setup(self, says: PlannerJoined | None) -> StackSetup:
        """Return what a worker starts it with; `says` is who it was when the sweep began."""
        return StackSetup(
            command=tuple(shlex.split(self.command)),
            folder=str(Path.cwd()),
            instances=self.instances,
            answer_within_s=self.answer_within_s,
            start_within_s=self.start_within_s,
            says=says,
        )

    def for_identity(self) -> RemoteStack:
        """Return it without what decides on no row: how long somebody waits."""
        return msgspec.structs.replace(
            self, answer_within_s=_STACK.answer_within_s, start_within_s=_STACK.start_within_s
        )


def check_remote(remote: Mapping[str, RemoteStack], *, control_hz: float) -> None:
    """Raise UserError for the first thing that is wrong with a spec's tables of stacks."""
    for name, stack in remote.items():
        for holds, text in _checks(name, stack, control_hz):
            if not holds:
                raise UserError(f"remote.{name}{text}")


def introduced(remote: Mapping[str, RemoteStack]) -> dict[str, PlannerJoined]:
    """Start each stack once and return what it says that it is; UserError where one cannot be."""
    return {name: _introduced(name, stack) for name, stack in remote.items()}


def _introduced(name: str, stack: RemoteStack) -> PlannerJoined:
    one = msgspec.structs.replace(stack.setup(None), instances=1)
    with temporary_folder("foretwin-stack-") as folder:
        processes = StackProcesses(name, one, folder=folder, owner="first")
        try:
            troubles = processes.make_ready()
            if troubles or processes.said is None:
                raise UserError(f"remote.{name} ({stack.command}): {troubles[0]}")
            return processes.said
        finally:
            processes.close()


def longest_wait_s(remote: Mapping[str, RemoteStack], *, horizon_s: float) -> float:
    """Return how long a worker may wait for stacks in one job before any of them counts as hung."""
    return max(
        (
            stack.start_within_s + stack.answer_within_s * stack.rate_hz * horizon_s
            for stack in remote.values()
        ),
        default=0.0,
    )


def _checks(name: str, stack: RemoteStack, control_hz: float) -> Iterator[tuple[bool, str]]:
    taken = name in planner_names()
    yield not taken, f": {name} is the name of a planner that is known already; take another"
    yield is_identifier(name), ": the name must be one word without / \\ * $ # ? { }"
    try:
        words = shlex.split(stack.command)
    except ValueError as error:
        yield False, f".command {stack.command!r}: {str(error).lower()}"
        return
    yield len(words) > 0, '.command: what starts it, such as "python my_stack.py"'
    most = MOST_INSTANCES
    yield 1 <= stack.instances <= most, f".instances {stack.instances}: 1 to {most}"
    ticks = control_hz / stack.rate_hz if stack.rate_hz > 0.0 else 0.0
    whole = ticks >= 1.0 - 1e-9 and abs(ticks - round(ticks)) < 1e-6
    yield whole, f".rate_hz {stack.rate_hz:g}: must divide control_hz {control_hz:g} evenly"
    latency = 0.0 <= stack.latency_s <= MOST_TOOK_S
    yield latency, f".latency_s {stack.latency_s:g}: 0 to {MOST_TOOK_S:g}"
    for what in ("answer_within_s", "start_within_s"):
        within = getattr(stack, what)
        yield 0.0 < within <= 86_400.0, f".{what} {within:g}: above 0, a day at most"
