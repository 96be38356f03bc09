"""Tasks and their answers, whoever plays them."""

from __future__ import annotations

from collections import deque

import pytest

from foretwin.contracts.placement import PlaceRequest
from foretwin.contracts.runner import Answer, Task, answers, place_task


class LastFirst:
    """A runner that answers what came last first, each task once."""

    capacity = 1
    workers = ("w0",)

    def __init__(self) -> None:
        self._tasks: deque[Task] = deque()

    def submit(self, task: Task) -> None:
        self._tasks.append(task)

    def cancel(self, key: str) -> None:
        self._tasks = deque(task for task in self._tasks if task.key != key)

    def take(self, timeout_s: float | None = 0.0) -> Answer | None:
        return Answer(self._tasks.pop(), "done") if self._tasks else None


def task(world_id: str) -> Task:
    return place_task(PlaceRequest(world_id=world_id, scenarios=(), vehicle="", most=1))


def test_every_task_is_answered_once_in_whatever_order() -> None:
    given = [task("a"), task("b"), task("c")]
    found = list(answers(LastFirst(), given))
    assert [answer.task.world_id for answer in found] == ["c", "b", "a"]
    assert {answer.message for answer in found} == {"done"}


@pytest.mark.parametrize("world_id", ["a", "b"])
def test_a_question_for_places_goes_to_who_has_the_world(world_id: str) -> None:
    asked = task(world_id)
    assert (asked.key, asked.channel, asked.world_id) == (
        f"places in {world_id}",
        "place",
        world_id,
    )
    assert asked.question == PlaceRequest(world_id=world_id, scenarios=(), vehicle="", most=1)
