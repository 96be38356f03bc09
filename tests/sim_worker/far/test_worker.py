"""A worker on another machine: told with what to play, it plays as any worker of the drive."""

from __future__ import annotations

import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import msgspec
import pytest

from foretwin.contracts.bus import Mailbox, Request, ask
from foretwin.contracts.codec import encode
from foretwin.contracts.errors import UserError
from foretwin.contracts.fleet import (
    Admittance,
    ClockQuestion,
    EnlistRequest,
    MachineInfo,
    WorldBytes,
)
from foretwin.contracts.job_identity import job_bytes
from foretwin.contracts.keys import alive_key
from foretwin.contracts.process import ProcessLife
from foretwin.contracts.runner import job_task
from foretwin.contracts.setup import BusSetup, FarWorkerSetup
from foretwin.contracts.simulation import PrepareRequest, RunEnd
from foretwin.contracts.world_identity import with_id
from foretwin.sim_worker.batch.batch_simulation import BatchSimulation
from foretwin.sim_worker.far.worker import serve_far
from foretwin.sim_worker.futures.future_mix import plan_futures
from foretwin.sim_worker.futures.result_digest import result_digest
from foretwin.sim_worker.futures.run_job import run_job
from foretwin.sim_worker.vehicle.parameters import load_vehicle
from tests.contracts.bus_sides import DEADLINE_S
from tests.contracts.memory_bus import MemoryBus
from tests.orchestrator.house import AtOnce
from tests.sim_worker.driving import altered
from tests.sim_worker.places import crossroads, job

IDS = {"run": "r1", "process": "w-laptop-0"}
WORLD = with_id(crossroads())
CAR = load_vehicle()
QUESTION = msgspec.structs.replace(
    job(plan_futures(count=4, seed=0, planners=["pure_pursuit_idm"]), horizon_s=2.0),
    world_id=WORLD.id,
)
ENLIST = EnlistRequest(vehicle=CAR, version=0, foretwin="1")


class Served:
    """A far worker in a thread, on a bus in memory on which a drive gives its World."""

    def __init__(self, folder: Path) -> None:
        self.bus = MemoryBus()
        self.setup = FarWorkerSetup(
            run_id="r1", process_id="w-laptop-0", vehicle_id="far", bus=BusSetup(endpoint=""),
            log_file=str(folder / "log.jsonl"), cache_dir=str(folder),
            machine=MachineInfo(cores=4, cpu="any", versions={}, arithmetic={}),
        )  # fmt: skip
        self.bus.serve("world_file", AtOnce(self._give), run="r1")  # type: ignore[arg-type]
        self.life = ProcessLife(self.setup, self.bus)
        self.error: Exception | None = None
        self.alive = Mailbox(4)
        self.bus.watch_alive(alive_key(**IDS), self.alive)
        self.thread = threading.Thread(target=self._serve)
        self.thread.start()
        assert self.alive.take(DEADLINE_S) is not None

    def _serve(self) -> None:
        try:
            serve_far(self.setup, self.bus, self.life)
        except UserError as error:
            self.error = error

    def _give(self, request: Request) -> None:
        request.reply(WorldBytes(data=encode(WORLD)))

    def ask(self, channel: str, question: msgspec.Struct) -> Any:
        return ask(self.bus, channel, question, timeout_s=DEADLINE_S, **IDS)

    def join(self) -> None:
        self.thread.join(DEADLINE_S)
        assert not self.thread.is_alive()


@pytest.fixture
def served(tmp_path: Path) -> Iterator[Served]:
    made = Served(tmp_path)
    yield made
    made.bus.publish("run_end", RunEnd(stamp_ns=0), run="r1")
    made.join()


def question(version: int = 0) -> msgspec.Struct:
    asked = msgspec.structs.replace(QUESTION, vehicle_version=version)
    return job_task(asked, job_bytes(asked)).question


def test_it_plays_the_bits_that_any_worker_plays(served: Served, tmp_path: Path) -> None:
    said = served.ask("enlist", ENLIST)
    assert (said.machine.cores, len(said.instance)) == (4, 8)
    assert served.ask("prepare", PrepareRequest(world_id=WORLD.id)).worker_id == "w-laptop-0"
    answer = served.ask("job", question())
    here = run_job(QUESTION, BatchSimulation(WORLD, CAR, nsim=32))
    assert result_digest(answer.result) == result_digest(here)
    assert not answer.leaving
    assert (tmp_path / f"{WORLD.id}.world").exists()


def test_told_again_it_has_other_parameters_and_is_the_same_one(served: Served) -> None:
    heavy = altered(CAR, mass_kg=1500.0)
    first = served.ask("enlist", ENLIST)
    again = served.ask("enlist", msgspec.structs.replace(ENLIST, vehicle=heavy, version=1))
    assert again == first
    with pytest.raises(TimeoutError, match="job for version 0"):
        served.ask("job", question())
    anew = run_job(
        msgspec.structs.replace(QUESTION, vehicle_version=1),
        BatchSimulation(WORLD, heavy, nsim=32),
    )
    assert result_digest(served.ask("job", question(1)).result) == result_digest(anew)


def test_work_before_it_was_told_with_what_is_refused(served: Served) -> None:
    with pytest.raises(TimeoutError, match="before it was told with what"):
        served.ask("job", question())


def test_a_planner_that_is_not_there_is_named(served: Served) -> None:
    with pytest.raises(TimeoutError, match="unknown planner 'magic'"):
        served.ask("enlist", msgspec.structs.replace(ENLIST, planners=("magic",)))


def test_the_clock_is_told_at_once(served: Served) -> None:
    before_ns = time.time_ns()
    assert before_ns <= served.ask("clock", ClockQuestion()).utc_ns <= time.time_ns()


def test_told_to_end_it_answers_what_it_was_asked_and_says_that_it_leaves(served: Served) -> None:
    served.ask("enlist", ENLIST)
    served.ask("prepare", PrepareRequest(world_id=WORLD.id))
    answers = Mailbox(4)
    served.bus.request("job", question(), answers, **IDS)
    served.life.terminated.set()
    served.join()
    reply = answers.take(0.0)
    assert reply.message.result is not None  # type: ignore[union-attr]
    assert reply.message.leaving  # type: ignore[union-attr]


def test_one_that_is_not_wanted_leaves_and_says_why(served: Served) -> None:
    assert served.ask("admit", Admittance(refused="other bits")) == Admittance(refused="other bits")
    served.join()
    assert str(served.error) == "other bits"
