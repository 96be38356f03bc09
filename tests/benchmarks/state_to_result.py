"""From a state to its 64 futures through two real workers, against a bare Zenoh question."""

from __future__ import annotations

import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any

import zenoh

from foretwin.contracts.bus import Bus, Mailbox, Reply, ZenohBus, ask, zenoh_config
from foretwin.contracts.codec import encode
from foretwin.contracts.futures import Job
from foretwin.contracts.job_identity import job_bytes
from foretwin.contracts.keys import alive_key
from foretwin.contracts.ports import free_endpoint
from foretwin.contracts.runner import job_task
from foretwin.contracts.setup import BusSetup, WorkerSetup, write_setup
from foretwin.contracts.simulation import PrepareRequest
from foretwin.sim_worker.futures.future_mix import plan_futures
from foretwin.sim_worker.vehicle.parameters import load_vehicle
from foretwin.world_gen.world_store import WorldStore
from tests.benchmarks import scenes
from tests.benchmarks.measuring import Measurement
from tests.contracts.bus_sides import python, take, take_until

ROUNDS = 20
BARE_ROUNDS = 200
WORKERS = ("w0", "w1")
RUN = "bench"
BARE_KEY = "foretwin/bench/bare"

ANSWERER = """
import sys
import zenoh
from foretwin.contracts.bus import zenoh_config
from foretwin.contracts.setup import BusSetup
answer = bytes(int(sys.argv[3]))

def reply(query):
    query.payload.to_bytes()
    query.reply(sys.argv[2], answer)

with zenoh.open(zenoh_config(BusSetup(endpoint=sys.argv[1]), router=False)) as session:
    session.declare_queryable(sys.argv[2], reply)
    print("ready", flush=True)
    sys.stdin.read()
"""


def measure() -> Measurement:
    """Return the median milliseconds of a whole round; the bare question has the same sizes."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        world = scenes.street(buildings=200)
        WorldStore(folder / "worlds").save(world)
        futures = plan_futures(count=scenes.FUTURES, seed=0, planners=["pure_pursuit_idm"])
        half = scenes.FUTURES // 2
        jobs = [scenes.job(world, futures[:half]), scenes.job(world, futures[half:])]
        round_ms, result_bytes = _round_ms(folder, jobs)
    return Measurement(round_ms, "ms", _bare_ms(len(encode(jobs[0])), result_bytes))


def _round_ms(folder: Path, jobs: list[Job]) -> tuple[float, int]:
    setup = BusSetup(endpoint=free_endpoint())
    replies = Mailbox(len(WORKERS))
    with ExitStack() as stack:
        bus = stack.enter_context(ZenohBus(setup, router=True))
        bus.declare_alive(alive_key(run=RUN, process="orchestrator"))
        for worker in WORKERS:
            stack.enter_context(_worker(folder, setup, worker))
        _await_workers(bus)
        for worker in WORKERS:
            request = PrepareRequest(world_id=jobs[0].world_id)
            ask(bus, "prepare", request, timeout_s=60.0, run=RUN, process=worker)
        taken_ms = []
        for _ in range(ROUNDS):
            start = time.perf_counter()
            for worker, job in zip(WORKERS, jobs, strict=True):
                asked = job_task(job, job_bytes(job)).question
                bus.request("job", asked, replies, timeout_s=60.0, run=RUN, process=worker)
            results = [_result(take(replies)) for _ in WORKERS]
            taken_ms.append(1000.0 * (time.perf_counter() - start))
    return statistics.median(taken_ms), len(encode(results[0]))


def _result(reply: Reply) -> Any:
    if reply.message is None:
        raise RuntimeError(f"a worker did not answer: {reply.error}")
    return reply.message


@contextmanager
def _worker(folder: Path, bus: BusSetup, process_id: str) -> Iterator[None]:
    """Run one worker process until the block ends."""
    file = folder / f"{process_id}.json"
    setup = WorkerSetup(
        run_id=RUN,
        process_id=process_id,
        vehicle_id="ego",
        bus=bus,
        log_file=str(folder / "log.jsonl"),
        role="futures",
        worlds_dir=str(folder / "worlds"),
        vehicle=load_vehicle(),
    )
    write_setup(setup, file)
    with subprocess.Popen(
        [sys.executable, "-m", "foretwin.sim_worker", "--setup", str(file)]
    ) as process:
        try:
            yield
        finally:
            process.kill()


def _await_workers(bus: Bus) -> None:
    alive = Mailbox(16)
    bus.watch_alive(alive_key(run=RUN, process="*"), alive)
    for _ in (*WORKERS, "orchestrator"):
        take_until(alive, lambda item: item.up)


def _bare_ms(question_bytes: int, answer_bytes: int) -> float:
    """Return the median milliseconds of a question through a router to another process."""
    setup = BusSetup(endpoint=free_endpoint())
    question = bytes(question_bytes)
    with (
        zenoh.open(zenoh_config(setup, router=True)) as session,
        python("-c", ANSWERER, setup.endpoint, BARE_KEY, str(answer_bytes)),
    ):
        while not list(session.get(BARE_KEY, payload=question)):
            pass
        taken_ms = []
        for _ in range(BARE_ROUNDS):
            start = time.perf_counter()
            (reply,) = session.get(BARE_KEY, payload=question)
            reply.ok.payload.to_bytes()
            taken_ms.append(1000.0 * (time.perf_counter() - start))
    return statistics.median(taken_ms)
