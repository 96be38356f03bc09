"""Questions to a runner: taken as they are needed, answered once each, encoded once."""

from __future__ import annotations

from collections import Counter, deque
from collections.abc import Iterator

import msgspec
import pytest

from foretwin.contracts.codec import content_bytes
from foretwin.contracts.job_identity import job_bytes
from foretwin.contracts.parts import JobCells
from foretwin.contracts.placement import PlaceRequest
from foretwin.contracts.runner import (
    Answer,
    JobRequest,
    Task,
    answers,
    job_task,
    place_task,
)
from foretwin.contracts.simulation import PrepareRequest
from tests.sim_worker.places import job


class Newest:
    """A runner that answers the newest task first, and counts how many it holds."""

    capacity, workers = 1, ("newest",)

    def __init__(self) -> None:
        self.held: deque[Task] = deque()
        self.most = 0

    def submit(self, task: Task) -> None:
        self.held.append(task)
        self.most = max(self.most, len(self.held))

    def cancel(self, key: str) -> None:
        raise NotImplementedError

    def take(self, timeout_s: float | None = 0.0) -> Answer | None:
        return Answer(self.held.pop(), None) if self.held else None


def task(number: int) -> Task:
    return Task(str(number), "prepare", "w", PrepareRequest(world_id="w"))


def test_a_large_cluster_is_given_twice_as_many_as_it_can_work_at() -> None:
    class Large(Newest):
        capacity = 256

    runner = Large()
    assert sum(1 for _ in answers(runner, map(task, range(768)))) == 768
    assert runner.most == 512


@pytest.mark.parametrize(("count", "ahead"), [(0, 3), (1, 3), (3, 3), (50, 3), (50, 1), (300, 256)])
def test_tasks_are_made_as_they_are_needed_and_each_is_answered(count: int, ahead: int) -> None:
    runner, made = Newest(), []

    def tasks() -> Iterator[Task]:
        for number in range(count):
            made.append(number)
            yield task(number)

    answered = []
    for answer in answers(runner, tasks(), ahead=ahead):
        answered.append(int(answer.task.key))
        assert len(made) - len(answered) < max(ahead, 1)
    assert sorted(answered) == made == list(range(count))
    assert runner.most == min(count, ahead)


class Odd(Newest):
    """Answers with how often it was asked for a task."""

    def __init__(self) -> None:
        super().__init__()
        self.asked: Counter[str] = Counter()

    def take(self, timeout_s: float | None = 0.0) -> Answer | None:
        if not self.held:
            return None
        one = self.held.pop()
        self.asked[one.key] += 1
        return Answer(one, self.asked[one.key], worker_id="odd")


def test_a_wrong_answer_does_not_count_and_its_task_is_asked_again() -> None:
    runner = Odd()

    def fault_in(answer: Answer) -> str:
        never, soon = answer.task.key == "1", answer.task.key == "2" and answer.message < 3
        return "garbage" if never or soon else ""

    said = {
        answer.task.key: (answer.message, answer.failure)
        for answer in answers(runner, map(task, range(4)), ahead=2, fault_in=fault_in)
    }
    assert said == {"0": (1, ""), "1": (None, "garbage"), "2": (3, ""), "3": (1, "")}
    assert runner.asked == {"0": 1, "1": 3, "2": 3, "3": 1}
    assert runner.most == 2


def test_a_job_goes_out_as_it_is_recorded() -> None:
    """What is sent is to the byte the message that holds the job itself."""

    class Whole(msgspec.Struct, frozen=True, kw_only=True):
        job: object
        sha256: str
        cells: JobCells | None

    one = job((), horizon_s=1.0)
    named = job_bytes(one)
    cells = JobCells(
        first=3, junction_id="n1", vehicle="car", scenarios=(), cases=(), places=(), attribution=""
    )
    asked = job_task(one, named, cells=cells)
    assert isinstance(asked.question, JobRequest)
    assert (asked.key, asked.channel, asked.world_id) == (named.sha256, "job", one.world_id)
    whole = Whole(job=one, sha256=named.sha256, cells=cells)
    assert content_bytes(asked.question) == content_bytes(whole)
    assert job_bytes(asked.question.decoded()) == named


def test_a_question_for_places_goes_to_who_has_the_world() -> None:
    asked = place_task(PlaceRequest(world_id="a", scenarios=(), vehicle="", most=1))
    assert (asked.key, asked.channel, asked.world_id) == ("places in a", "place", "a")
