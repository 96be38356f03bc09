from __future__ import annotations

import json
import os
import subprocess
import sys
import threading
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import msgspec
import pytest

from foretwin.contracts.bus import Alive, Bus, Mailbox, Received, ZenohBus, ask
from foretwin.contracts.codec import write_message
from foretwin.contracts.drive import ControlCommand
from foretwin.contracts.futures import Future, Job
from foretwin.contracts.job_identity import job_bytes
from foretwin.contracts.keys import alive_key
from foretwin.contracts.parts import JobCells
from foretwin.contracts.ports import free_endpoint
from foretwin.contracts.process import ProcessLife
from foretwin.contracts.runner import job_task
from foretwin.contracts.setup import BusSetup, StackSetup, WorkerSetup, write_setup
from foretwin.contracts.simulation import (
    ActiveWorld,
    MirrorSample,
    PrepareReply,
    PrepareRequest,
    RunEnd,
)
from foretwin.contracts.tuning import UseVehicle
from foretwin.contracts.world import World
from foretwin.sim_worker.batch.batch_simulation import BatchSimulation
from foretwin.sim_worker.futures.finished_part import finished_part
from foretwin.sim_worker.futures.future_mix import plan_futures
from foretwin.sim_worker.futures.result_digest import result_digest
from foretwin.sim_worker.futures.run_job import run_job
from foretwin.sim_worker.mirror.process import serve_mirror
from foretwin.sim_worker.planners.hosted import ALIVE_S, ANSWER_S, HostedPlanner
from foretwin.sim_worker.planners.registry import load_planner
from foretwin.sim_worker.planners.remote import RemotePlanner
from foretwin.sim_worker.vehicle.parameters import load_vehicle
from foretwin.sim_worker.worker import FuturesWorker, SimulationCache, serve_futures
from foretwin.sim_worker.world_file import WorldFolder, load_world
from tests.contracts.bus_sides import DEADLINE_S
from tests.contracts.memory_bus import MemoryBus
from tests.sim_worker.driving import altered
from tests.sim_worker.futures.cells import cells_for
from tests.sim_worker.places import FRAME, crossroads, job, state_at
from tests.sim_worker.planners.installed import install
from tests.starvation import unhindered_wait_s
from tests.system.foretwin_command import REPOSITORY, is_running, wait_for

COVERS = ("foretwin.sim_worker.world_file",)

CAR = load_vehicle()
RUN = {"run": "r1"}
IDS = {"run": "r1", "process": "w0"}


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    write_message(crossroads(), tmp_path / "crossroads.world")
    return tmp_path


def _setup(
    folder: Path, *, role: str = "futures", endpoint: str = "tcp/127.0.0.1:1"
) -> WorkerSetup:
    return WorkerSetup(
        run_id="r1", process_id="w0", vehicle_id="car", bus=BusSetup(endpoint=endpoint),
        log_file=str(folder / "log.jsonl"), role=role, worlds_dir=str(folder), vehicle=CAR,
        drive_frame=FRAME,
    )  # fmt: skip


@pytest.fixture
def served(folder: Path) -> Iterator[MemoryBus]:
    """A futures worker in a thread on a bus in memory."""
    bus = MemoryBus()
    setup = _setup(folder)
    life = ProcessLife(setup, bus)
    alive = Mailbox(4)
    bus.watch_alive(alive_key(run="r1", process="w0"), alive)
    thread = threading.Thread(target=serve_futures, args=(setup, bus, life))
    thread.start()
    assert alive.take(DEADLINE_S) is not None
    yield bus
    bus.publish("run_end", RunEnd(stamp_ns=0), **RUN)
    thread.join(DEADLINE_S)
    assert not thread.is_alive()


def request(question: Job, cells: JobCells | None = None) -> msgspec.Struct:
    return job_task(question, job_bytes(question), cells=cells).question


def asked(bus: MemoryBus, channel: str, question: msgspec.Struct) -> Any:
    return ask(bus, channel, question, timeout_s=DEADLINE_S, **IDS)


def test_a_worker_prepares_worlds_and_answers_jobs(served: MemoryBus) -> None:
    prepared = asked(served, "prepare", PrepareRequest(world_id="crossroads"))
    assert (prepared.world_id, prepared.worker_id) == ("crossroads", "w0")
    question = job(plan_futures(count=4, seed=0, planners=["pure_pursuit_idm"]), horizon_s=2.0)
    answer = asked(served, "job", request(question))
    result = answer.result
    assert result.worker_id == "w0"
    again = asked(served, "job", request(question))
    assert 0.0 < answer.cpu_s < again.cpu_s - 0.5 * result.cpu_seconds
    here = run_job(question, BatchSimulation(crossroads(), CAR, nsim=32))
    assert result_digest(result) == result_digest(here)


@pytest.mark.parametrize("lossless", [True, False])
def test_in_lock_step_planners_of_others_are_waited_for(
    folder: Path, lossless: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    install(folder, "waited_for", "class Mine:\n    def plan(self, view): ...\n", mine="Mine")
    monkeypatch.syspath_prepend(folder)
    bus, setup = MemoryBus(), _setup(folder)
    setup = msgspec.structs.replace(
        setup,
        planners=("remote", "mine"),
        bus=msgspec.structs.replace(setup.bus, lossless=lossless),
    )
    life = ProcessLife(setup, bus)
    bus.publish("run_end", RunEnd(stamp_ns=0), **RUN)
    load_planner.cache_clear()
    serve_futures(setup, bus, life)
    remote, mine = load_planner("remote"), load_planner("mine")
    load_planner.cache_clear()
    assert isinstance(mine, HostedPlanner)
    mine.close()
    assert mine.answer_s == (ALIVE_S if lossless else ANSWER_S)
    assert isinstance(remote, RemotePlanner)
    assert remote.lock_step == lossless


def test_a_worker_ends_the_stacks_that_it_started(folder: Path) -> None:
    command = (sys.executable, "-m", "tests.sim_worker.planners.a_stack", "straight")
    stack = StackSetup(command=command, folder=str(REPOSITORY), start_within_s=DEADLINE_S)
    setup = msgspec.structs.replace(_setup(folder), stacks=(("mine", stack),))
    worker = FuturesWorker(setup)
    question = job((Future(index=0, name="f", planner="mine"),), horizon_s=1.0)
    result = worker.answer("job", request(question)).result
    assert result.outcome.failures == ()
    pids = worker.stacks["mine"].processes.pids
    assert all(map(is_running, pids))
    worker.close()
    wait_for(lambda: not any(map(is_running, pids)), "the end of the stack")


def test_a_part_is_what_the_result_comes_to_and_the_job_is_the_same(served: MemoryBus) -> None:
    question = job(plan_futures(count=4, seed=0, planners=["pure_pursuit_idm"]), horizon_s=2.0)
    cells = cells_for(question)
    answer = asked(served, "job", request(question, cells))
    assert answer.result is None
    result = asked(served, "job", request(question)).result
    assert answer.part == finished_part(question, job_bytes(question), result, cells)


def test_a_question_that_cannot_be_answered_is_refused_and_the_worker_goes_on(
    served: MemoryBus,
) -> None:
    with pytest.raises(TimeoutError, match=r"FileNotFoundError.*nowhere\.world"):
        asked(served, "prepare", PrepareRequest(world_id="nowhere"))
    with pytest.raises(TimeoutError, match="is no plain name"):
        asked(served, "prepare", PrepareRequest(world_id="../crossroads"))
    question = job(plan_futures(count=2, seed=0, planners=["magic"]))
    with pytest.raises(TimeoutError, match="unknown planner 'magic'"):
        asked(served, "job", request(question))
    assert asked(served, "prepare", PrepareRequest(world_id="crossroads")).seconds < 10.0


def test_a_worker_goes_on_with_other_parameters_and_says_with_which(served: MemoryBus) -> None:
    """As a worker started with them would, to the bit, in a World that it holds compiled."""
    heavy = altered(CAR, mass_kg=1500.0, wheelbase_m=2.9, steering_lag_s=0.1)
    futures = plan_futures(count=4, seed=0, planners=["pure_pursuit_idm"])
    before = job(futures, horizon_s=2.0)
    after = msgspec.structs.replace(before, vehicle_version=1)
    no_car = altered(CAR, steering_delay_s=-1.4)
    with pytest.raises(TimeoutError, match=r"steering_delay_s .* is implausible"):
        asked(served, "use_vehicle", UseVehicle(stamp_ns=0, vehicle=no_car, version=1))
    first = asked(served, "job", request(before)).result
    with pytest.raises(TimeoutError, match=r"job for version 1 .* at a worker with version 0"):
        asked(served, "job", request(after))
    use = UseVehicle(stamp_ns=0, vehicle=heavy, version=1)
    assert asked(served, "use_vehicle", use) == use
    second = asked(served, "job", request(after)).result
    assert (first.vehicle_version, second.vehicle_version) == (0, 1)
    anew = run_job(after, BatchSimulation(crossroads(), heavy, nsim=32))
    assert result_digest(second) == result_digest(anew) != result_digest(first)


def test_the_cache_keeps_the_worlds_used_last(folder: Path) -> None:
    for name in "abc":
        world = msgspec.structs.replace(crossroads(), id=name)
        write_message(world, folder / f"{name}.world")
    setup = msgspec.structs.replace(_setup(folder), simulations=2, kept_worlds=2)
    cache = SimulationCache(setup, CAR, worlds=WorldFolder(folder))
    first = cache.get("a")
    cache.get("b")
    assert cache.get("a") is first
    cache.get("c")
    assert cache.world_ids == ("a", "c")


def test_a_worker_takes_its_worlds_from_wherever_it_is_told(tmp_path: Path) -> None:
    class Elsewhere:
        def world(self, world_id: str) -> World:
            return msgspec.structs.replace(crossroads(), id=world_id)

    worker = FuturesWorker(_setup(tmp_path), worlds=Elsewhere())
    answer = worker.answer("prepare", PrepareRequest(world_id="from afar"))
    assert isinstance(answer, PrepareReply)
    assert answer.world_id == "from afar"
    assert "drivable" in vars(worker._stages.get("from afar").scenes), "before the first job"


@pytest.mark.parametrize("world_id", ["", "../secret", "a\\\\b", ".hidden"])
def test_a_worlds_id_names_a_file_of_its_folder_and_no_other(folder: Path, world_id: str) -> None:
    with pytest.raises(FileNotFoundError, match="names no file in"):
        load_world(folder, world_id)


def _drive_past(bus: Bus, *, count: int = 101) -> None:
    for k in range(count):
        stamp_ns = k * 20_000_000
        command = ControlCommand(stamp_ns=stamp_ns, accel_mps2=0.0, tire_angle_rad=0.0)
        bus.publish("control", command, vehicle="car")
        bus.publish("state", state_at(-50 + 0.16 * k, -1.5, stamp_ns=stamp_ns), vehicle="car")


def test_a_mirror_worker_turns_states_into_samples(folder: Path) -> None:
    bus = MemoryBus()
    setup = _setup(folder, role="mirror")
    life = ProcessLife(setup, bus)
    heard, alive = Mailbox(200), Mailbox(4)
    bus.subscribe("mirror", heard, **RUN)
    bus.watch_alive(alive_key(run="r1", process="w0"), alive)
    thread = threading.Thread(target=serve_mirror, args=(setup, bus, life))
    thread.start()
    assert alive.take(DEADLINE_S) is not None
    nowhere = ActiveWorld(stamp_ns=1_000_000_000, world_id="nowhere")
    crossroads_world = ActiveWorld(stamp_ns=1_000_000_000, world_id="crossroads")
    with pytest.raises(TimeoutError, match="nowhere"):
        ask(bus, "use_world", nowhere, process="w0", **RUN)
    assert ask(bus, "use_world", crossroads_world, process="w0", **RUN) == crossroads_world
    _drive_past(bus)
    samples = [_sample(heard) for _ in range(21)]
    bus.publish("run_end", RunEnd(stamp_ns=0), **RUN)
    thread.join(DEADLINE_S)
    assert not thread.is_alive()
    assert [sample.stamp_ns for sample in samples] == [k * 100_000_000 for k in range(21)]
    assert [sample.world_id for sample in samples] == [None] * 10 + ["crossroads"] * 11
    assert max(sample.gap_m for sample in samples) < 0.01


def _sample(mailbox: Mailbox) -> MirrorSample:
    item = mailbox.take(DEADLINE_S)
    assert isinstance(item, Received)
    message = item.message()
    assert isinstance(message, MirrorSample)
    return message


def test_a_worker_process_over_zenoh_answers_logs_and_leaves(folder: Path) -> None:
    endpoint = free_endpoint()
    write_setup(_setup(folder, endpoint=endpoint), folder / "setup.json")
    with ZenohBus(BusSetup(endpoint=endpoint), router=True) as bus:
        alive = Mailbox(8)
        bus.watch_alive(alive_key(run="r1", process="w0"), alive)
        process = subprocess.Popen(
            [sys.executable, "-m", "foretwin.sim_worker", "--setup", str(folder / "setup.json")],
            env={**os.environ, "PYTHONWARNINGS": "error"},
        )
        try:
            up = alive.take(DEADLINE_S)
            assert isinstance(up, Alive)
            assert up.up
            with pytest.raises(TimeoutError, match=r"nowhere\.world"):
                ask(bus, "prepare", PrepareRequest(world_id="nowhere"), timeout_s=DEADLINE_S, **IDS)
            question = job(plan_futures(count=8, seed=0, planners=["pure_pursuit_idm"]))
            result = ask(bus, "job", request(question), timeout_s=DEADLINE_S, **IDS).result
            here = run_job(question, BatchSimulation(crossroads(), CAR, nsim=32))
            assert result_digest(result) == result_digest(here)
            bus.publish("run_end", RunEnd(stamp_ns=0), **RUN)
            assert unhindered_wait_s(process, DEADLINE_S) < 3.0
            assert process.returncode == 0
        finally:
            process.kill()
            process.wait(DEADLINE_S)
    lines = [json.loads(line) for line in (folder / "log.jsonl").read_text().splitlines()]
    refused = [line for line in lines if line["text"] == "prepare refused"]
    assert len(refused) == 1
    assert refused[0]["process"] == "w0"
    assert "FileNotFoundError" in refused[0]["traceback"]
