"""The builder of a drive, asked for one World in this process."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from foretwin.contracts.simulation import BuildReply, BuildRequest
from foretwin.contracts.world import World
from foretwin.orchestrator.drive.processes import PROCESSES
from foretwin.orchestrator.plan import DrivePlan
from foretwin.orchestrator.worlds.builder_process import serve_builds
from foretwin.world_gen.world_store import WorldStore
from tests.contracts.memory_bus import MemoryBus


class UntilAnswered:
    """A life that lasts for one question; asks it as the builder is ready."""

    def __init__(self, ask: Callable[[], None], answered: Callable[[], bool]) -> None:
        self.ready, self._answered = ask, answered

    @property
    def over(self) -> bool:
        return self._answered()


def built(plan: DrivePlan, junction_id: str) -> World:
    """Return the World of a junction that the builder of a drive gives."""
    (row,) = (row for row in PROCESSES if row.name == "builder")
    bus, answers = MemoryBus(), list[Any]()
    box = type("Answers", (), {"put": lambda _, item: answers.append(item)})()

    def ask() -> None:
        request = BuildRequest(intersection_id=junction_id, radius_m=150.0)
        bus.request("build", request, box, run=plan.run_id, process="builder")

    setup = row.setup(plan, "builder")
    serve_builds(setup, bus, UntilAnswered(ask, lambda: bool(answers)))  # type: ignore[arg-type]
    (answer,) = answers
    assert isinstance(answer.message, BuildReply), answer.error
    return WorldStore(plan.worlds_dir).load(answer.message.world_id)
