"""Real worker processes over Zenoh: who dies or hangs costs time, and one task at most."""

from __future__ import annotations

import os
import signal
from pathlib import Path

import pytest

from foretwin.contracts.keys import alive_key
from foretwin.contracts.runner import Task, answers
from foretwin.contracts.setup import BusSetup, ProcessSetup, WorkerSetup
from foretwin.contracts.simulation import PrepareRequest
from foretwin.orchestrator.runner.dispatch import ATTEMPTS
from foretwin.orchestrator.runner.launch import Child, FreshInterpreter
from foretwin.orchestrator.runner.worker_processes import NoWorkerError, WorkerProcesses
from foretwin.sim_worker.vehicle.parameters import load_vehicle
from tests.contracts.bus_sides import DEADLINE_S

ROOT = Path(__file__).parents[3]


class OddWorkers:
    """Starts odd workers in place of foretwin's."""

    def __init__(self, folder: Path) -> None:
        self._launch = FreshInterpreter(folder, package="tests.orchestrator.runner")

    def __call__(self, *, module: str, setup: ProcessSetup) -> Child:
        assert module == "sim_worker"
        return self._launch(module="odd_worker", setup=setup)


@pytest.fixture(autouse=True)
def _tests_can_be_imported(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PYTHONPATH", str(ROOT))


def runner(
    folder: Path, *, workers: int = 2, timeout_s: float = DEADLINE_S, role: str = "odd"
) -> WorkerProcesses:
    setup = WorkerSetup(
        run_id="r1", process_id="w", vehicle_id="car", bus=BusSetup(endpoint=""),
        log_file=str(folder / "log.jsonl"), role=role, worlds_dir=str(folder),
        vehicle=load_vehicle(),
    )  # fmt: skip
    return WorkerProcesses(
        workers, setup, task_timeout_s=timeout_s, folder=folder / "processes",
        launch=OddWorkers(folder / "processes"),
    )  # fmt: skip


def tasks(*questions: str) -> list[Task]:
    return [
        Task(f"{number} {question}", "prepare", "w", PrepareRequest(world_id=question))
        for number, question in enumerate(questions)
    ]


def asked(workers: WorkerProcesses, *questions: str) -> list[str]:
    """What became of each question: its own words, or why there is no answer."""
    found = {}
    with workers:
        for answer in answers(workers, tasks(*questions)):
            assert answer.task.key not in found
            found[answer.task.key] = answer.failure or answer.message.world_id
        pids = workers.pids
    for pid in pids:
        with pytest.raises(ProcessLookupError):
            os.kill(pid, 0)
    return [found[task.key] for task in tasks(*questions)]


def test_the_task_of_a_killed_worker_goes_to_another(tmp_path: Path) -> None:
    questions = ("a", "die-once", "b", "c")
    assert asked(runner(tmp_path), *questions) == list(questions)
    assert (tmp_path / "died").exists()


def test_a_task_that_kills_every_worker_is_given_up_and_the_others_go_on(tmp_path: Path) -> None:
    lost = f"{ATTEMPTS} workers died of it, the last by signal 9"
    assert asked(runner(tmp_path, workers=1), "die", "a", "b") == [lost, "a", "b"]


def test_a_task_without_an_answer_in_time_is_given_up(tmp_path: Path) -> None:
    workers = runner(tmp_path, workers=1, timeout_s=1.0)
    assert asked(workers, "hang", "a") == ["no answer in 1 s", "a"]


def test_a_task_that_is_refused_is_not_tried_again(tmp_path: Path) -> None:
    assert asked(runner(tmp_path, workers=1), "refuse", "a") == ["no such World", "a"]


def test_what_one_worker_refuses_another_does_though_none_other_was_wanted_yet(
    tmp_path: Path,
) -> None:
    workers = runner(tmp_path, workers=2)
    assert asked(workers, "refuse-w0") == ["refuse-w0"]


def test_a_sick_worker_costs_no_task(tmp_path: Path) -> None:
    questions = [f"refuse-w0-{number}" for number in range(8)]
    assert asked(runner(tmp_path, workers=2), *questions) == questions


def test_a_task_fails_once_every_worker_refused_it(tmp_path: Path) -> None:
    found = asked(runner(tmp_path, workers=2), "refuse", "a", "refuse-w0-w1", "b")
    assert found == ["no such World", "a", "no such World", "b"]


def test_a_stranger_on_the_bus_is_given_nothing(tmp_path: Path) -> None:
    workers = runner(tmp_path, workers=1)
    with workers:
        assert workers._bus is not None
        workers._bus.declare_alive(alive_key(run="r1", process="w9"))
        assert [a.worker_id for a in answers(workers, tasks("a", "b", "c"))] == ["w0"] * 3
        assert workers.workers == ("w0",)


def test_a_worker_that_was_killed_from_outside_is_replaced(tmp_path: Path) -> None:
    with runner(tmp_path, workers=1) as workers:
        assert [a.message.world_id for a in answers(workers, tasks("a"))] == ["a"]
        (pid,) = workers.pids
        os.kill(pid, signal.SIGKILL)
        assert [a.message.world_id for a in answers(workers, tasks("b"))] == ["b"]
        assert workers.pids != [pid]


def test_an_exception_ends_all_processes(tmp_path: Path) -> None:
    workers = runner(tmp_path)
    pids: list[int] = []

    def interrupt() -> None:
        with workers:
            next(answers(workers, tasks("a", "hang")))
            pids.extend(workers.pids)
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        interrupt()
    assert len(pids) == 2
    assert workers.pids == []


def test_workers_that_cannot_be_started_are_said(tmp_path: Path) -> None:
    workers = runner(tmp_path, workers=1, role="never up")
    with pytest.raises(NoWorkerError, match=r"no worker can be started; see .*log\.jsonl"):
        asked(workers, "a")
    assert "no licence" in (tmp_path / "log.jsonl").read_text()
