"""A cluster on which each question ends when a test says so, and a runner on it."""

from __future__ import annotations

import math
from collections.abc import Collection
from concurrent.futures import Future
from typing import Any

from foretwin.contracts.codec import encode
from foretwin.contracts.runner import Runner, Task
from foretwin.contracts.simulation import PrepareReply, PrepareRequest
from foretwin.orchestrator.runner.ray_runner import Ended, RayRunner
from foretwin.sim_worker.seat import SeatAnswer, SeatQuestion

DONE = encode(PrepareReply(world_id="A", worker_id="w", seconds=0.0))


class OneByOne:
    """A cluster on which a question ends when the test says so."""

    def __init__(self, *seats: str) -> None:
        self.names = seats or ("n1-0", "n1-1")
        self.asked: list[tuple[SeatQuestion, Any, Future[Ended]]] = []
        self.away_from: list[set[str]] = []
        """Of each question, who was not to answer it."""
        self.stored: list[bytes] = []
        self.forgotten, self.lost_s = 0, -math.inf

    def seats(self) -> tuple[str, ...]:
        return self.names

    def put(self, data: bytes) -> Any:
        self.stored.append(data)
        return data

    def ask(
        self, question: SeatQuestion, world: Any | None, *, away_from: Collection[str] = ()
    ) -> Future[Ended]:
        self.away_from.append(set(away_from))
        ended: Future[Ended] = Future()
        self.asked.append((question, world, ended))
        return ended

    def forget(self, asked: Future[Ended]) -> None:
        self.forgotten += 1

    def end(self, which: int = 0, *, node: str = "n1", **answer: Any) -> None:
        *_, ended = self.asked.pop(which)
        ended.set_result(Ended(SeatAnswer(f"{node}-0", **{"data": DONE, **answer}), node=node))

    def lose(self, trouble: str) -> None:
        *_, ended = self.asked.pop(0)
        ended.set_result(Ended(None, trouble))


def task(key: str, world_id: str = "A", channel: str = "prepare") -> Task:
    return Task(key, channel, world_id, PrepareRequest(world_id=world_id))


def on(cluster: OneByOne, *, most: int | None = None, **options: Any) -> RayRunner:
    options = {"world_file": lambda name: name.encode(), "task_timeout_s": 60.0} | options
    return RayRunner(cluster, most=most, **options)


def counted(runner: Runner) -> tuple[int, int, int, int]:
    count = runner.count
    return count.given, count.results, count.refused, count.lost
