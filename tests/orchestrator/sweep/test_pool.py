"""Worker processes of a sweep: who dies or hangs costs its own task at most."""

from __future__ import annotations

import os
import signal
import time
from collections.abc import Callable
from pathlib import Path

import pytest

from foretwin.orchestrator.sweep.pool import ATTEMPTS, Crew, Lost, Task

WAIT_S = 60.0


def start(setup: str) -> Callable[[object], object]:
    """Answer: `double 4`, `die once FILE`, `die`, `hang`."""

    def answer(question: object) -> object:
        word, *rest = str(question).split()
        if word == "double":
            return 2 * int(rest[0])
        if word == "die" and not (rest and Path(rest[1]).exists()):
            if rest:
                Path(rest[1]).write_text(setup)
            os.kill(os.getpid(), signal.SIGKILL)
        if word == "hang":
            time.sleep(WAIT_S)
        return word

    return answer


def answers(questions: list[str], *, workers: int = 2, timeout_s: float = WAIT_S) -> list[object]:
    found: dict[int, object] = {}
    tasks = [Task(i, question.split()[0], question) for i, question in enumerate(questions)]
    with Crew(workers, start, "said", timeout_s=timeout_s) as crew:
        crew.run(tasks, lambda task, answer: found.update({task.number: answer}))
        pids = crew.pids
    for pid in pids:
        with pytest.raises(ProcessLookupError):
            os.kill(pid, 0)
    return [found[number] for number in range(len(questions))]


def test_the_task_of_a_killed_worker_goes_to_another(tmp_path: Path) -> None:
    once = f"die once {tmp_path / 'died'}"
    assert answers(["double 1", once, "double 2", "double 3"]) == [2, "die", 4, 6]


def test_a_task_that_kills_every_worker_is_given_up_and_the_others_go_on() -> None:
    lost, *others = answers(["die", "double 2"], workers=1)
    assert lost == Lost(f"{ATTEMPTS} workers died of it, the last by signal 9")
    assert others == [4]


def test_a_task_without_an_answer_in_time_is_given_up() -> None:
    assert answers(["hang", "double 2"], timeout_s=4.0) == [Lost("no answer in 4 s"), 4]


def test_an_exception_ends_all_processes() -> None:
    def refuse(task: Task, answer: object) -> None:
        raise KeyboardInterrupt

    crew = Crew(2, start, "said", timeout_s=WAIT_S)
    with pytest.raises(KeyboardInterrupt), crew:
        crew.run([Task(0, "", "double 1"), Task(1, "", "hang")], refuse)
    assert crew.pids == []
