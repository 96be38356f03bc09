"""What was measured, as it is kept in the repository, and how it is measured anew."""

from __future__ import annotations

import datetime
import json
import os
import statistics
import tempfile
import time
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
import pyarrow.parquet as pq

from foretwin.contracts.codec import encode
from foretwin.contracts.runner import Task
from foretwin.contracts.versions import processor
from foretwin.orchestrator.embedded import MAP_FILE
from foretwin.orchestrator.runner.dispatch import Dispatch
from foretwin.orchestrator.runner.worker_processes import IN_FLIGHT
from foretwin.orchestrator.worlds.opening import open_map
from foretwin.telemetry.logs.opening import open_log
from foretwin.world_gen.junctions.map_index import index_map
from foretwin.world_gen.world_store import WorldStore, cached_build
from tests.benchmarks.live_drive import SETTLED_S, drive_live
from tests.scale.sweep_model import JobShape
from tests.scale.sweep_runs import SweepRun, play
from tests.scale.workload import MANY_VEHICLES, Workload

FITTED = ((1, 16), (1, 64), (2, 16))
"""Workers and futures a job of the sweeps that the model is fitted on."""
HELD_OUT = ((2, 64), (2, 32), (3, 64))
"""Those that it predicts; 3 workers share two cores."""
REPEATS = 3
DISPATCH_WORKERS = (2, 16, 64, 256)
_TELEMETRY = (
    "imu", "gnss", "speed", "heading", "steering", "control", "plan", "status", "objects",
    "signals",
)  # fmt: skip


class Dispatched(msgspec.Struct, frozen=True):
    """CPU seconds for a job given out and answered, with so many workers."""

    workers: int
    cpu_s: float


class Car(msgspec.Struct, frozen=True, kw_only=True):
    """One car's live drive through the drawn town, on two workers of this machine."""

    rounds_cpu_s: tuple[float, ...]
    """Of the jobs of each round together."""
    start_s: float
    end_s: float
    latency_s: tuple[float, ...]
    """Of each round, from state to view."""
    orchestrator_cores: float
    others_cores: float
    samples_per_s: float
    sample_cpu_s: float
    question_bytes: float
    answer_bytes: float
    telemetry_bytes_per_s: float
    recorded_bytes_per_s: float
    """What the car's own disk takes of it, recording and results."""


class Worlds(msgspec.Struct, frozen=True):
    """On average of a World of the drawn town."""

    build_cpu_s: float
    place_cpu_s: float
    compile_cpu_s: float
    file_bytes: float


class Stored(msgspec.Struct, frozen=True):
    """Bytes of a sweep's files, and of its questions and answers by job of 64."""

    part_bytes: float
    """Of the tables of a job, however many futures it has: schemas, statistics, the job."""
    row_bytes: float
    """Of each future besides."""
    files_per_job: float
    question_bytes: float
    answer_bytes: float


class Measured(msgspec.Struct, frozen=True, kw_only=True):
    """Everything that the model is fed with."""

    day: str
    processor: str
    cores: int
    load: tuple[float, float]
    """Of the machine, as the measuring began and ended."""
    runs: tuple[SweepRun, ...]
    shapes: dict[str, tuple[tuple[str, int], ...]]
    """The jobs of the sweep by futures a job: their Worlds and futures."""
    dispatched: tuple[Dispatched, ...]
    worlds: Worlds
    stored: Stored
    car: Car

    def runs_of(self, workers: int, futures_per_job: int) -> list[SweepRun]:
        """Return the repeats of a configuration."""
        wanted = workers, futures_per_job, 1
        return [r for r in self.runs if (r.workers, r.futures_per_job, r.vehicles) == wanted]

    def jobs_of(self, futures_per_job: int) -> list[JobShape]:
        """Return the jobs of a configuration."""
        return [JobShape._make(one) for one in self.shapes[str(futures_per_job)]]


def measure_sweeps(folder: Path) -> tuple[list[SweepRun], dict[str, Workload]]:
    """Play all configurations in turn, in an order that changes."""
    sizes = sorted({size for _, size in FITTED + HELD_OUT})
    loads = {str(size): Workload(folder, size) for size in sizes}
    # More jobs tell what one costs the parent from how it begins.
    many = Workload(folder, 16, MANY_VEHICLES)
    runs = []
    for repeat in range(REPEATS):
        turn = FITTED + HELD_OUT
        for workers, size in turn if repeat % 2 else turn[::-1]:
            name = f"{workers}-{repeat}"
            runs.append(play(loads[str(size)], name, workers=workers))
        runs.append(play(many, f"many-{repeat}", workers=2))
    return runs, loads


def measure_dispatch(workers: int, jobs: int = 512) -> Dispatched:
    """Give jobs of eight Worlds out to workers that answer in turn."""
    names = [f"w{n}" for n in range(workers)]
    dispatch = Dispatch(in_flight=IN_FLIGHT)
    dispatch.expect(names)
    for name in names:
        dispatch.worker_up(name)
    tasks = [Task(f"{n}", "job", f"world-{n * 8 // jobs}", encode) for n in range(jobs)]  # type: ignore[arg-type]
    begun_s = time.process_time()
    for task in tasks[:256]:
        dispatch.submit(task)
    given = dispatch.assignments(now_s=0.0)
    left = iter(tasks[256:])
    answered = 0
    while given:
        one = given.pop(0)
        answered += dispatch.answered(one.worker_id, one.task.key)
        for task in left:
            dispatch.submit(task)
            break
        given += dispatch.assignments(now_s=0.0)
    assert answered == jobs
    return Dispatched(workers, (time.process_time() - begun_s) / jobs)


def measure_worlds(folder: Path, loaded: Workload) -> Worlds:
    """Build the Worlds of the drawn town."""
    opened = open_map(MAP_FILE)
    index = index_map(opened.osm, opened.graph, opened.junctions)
    store = WorldStore(folder / "built")
    cached_build(store, index, opened.junctions[0])
    taken_s = []
    for junction in opened.junctions[1:9]:
        begun_s = time.process_time()
        cached_build(store, index, junction)
        taken_s.append(time.process_time() - begun_s)
    files = list((folder / "built").rglob("*.world"))
    return Worlds(
        build_cpu_s=statistics.mean(taken_s),
        place_cpu_s=loaded.place_cpu_s,
        compile_cpu_s=0.0,
        file_bytes=statistics.mean(file.stat().st_size for file in files),
    )


def measure_stored(few: Workload, many: Workload, answer_bytes: float) -> Stored:
    """Weigh the folders of two sweeps, of as many jobs with few futures and with many."""
    weights = [
        sum(file.stat().st_size for file in load.played.rglob("job-*.parquet")) / load.jobs
        for load in (few, many)
    ]
    row_bytes = (weights[1] - weights[0]) / ((many.futures - few.futures) / many.jobs)
    parts = (many.played / "jobs").glob("*.parquet")
    rows = [row for part in parts for row in pq.read_table(part).to_pylist()]
    return Stored(
        part_bytes=weights[1] - row_bytes * many.futures / many.jobs,
        row_bytes=row_bytes,
        files_per_job=len(list(many.played.rglob("job-*.parquet"))) / many.jobs,
        question_bytes=statistics.mean(len(row["job"]) for row in rows),
        answer_bytes=answer_bytes,
    )


def measure_car(folder: Path) -> Car:
    """Drive through the town, traced, and read what its rounds and samples took."""
    folder.mkdir()
    drive = drive_live(["--trace"], folder)
    (run,) = (folder / "runs").iterdir()
    events = json.loads((run / "trace.json").read_bytes())["traceEvents"]
    names = {e["pid"]: e["args"]["name"] for e in events if e["name"] == "process_name"}
    spans = [e for e in events if e["ph"] == "X"]
    own = [e for e in spans if names[e["pid"]] == "orchestrator"]
    answers = [e["args"]["bytes"] for e in own if e["name"] == "decode an answer"]
    samples = [e for e in own if e["name"] == "take a sample"]
    seconds = (max(e["ts"] for e in samples) - min(e["ts"] for e in samples)) / 1e6
    taken = [e["tdur"] / 1e6 for e in own if e["name"] in _TELEMETRY]
    rounds = pq.read_table(run / "results" / "rounds.parquet").to_pylist()
    settled = [row for row in rounds if row["drive_time_s"] >= SETTLED_S]
    jobs = [r for p in run.rglob("jobs*.parquet") for r in pq.read_table(p).to_pylist()]
    log = open_log(run / "drive.mcap")
    sent = sum(len(encode(message)) + 24 for name, message in log.samples() if name != "state")
    on_disk = sum(f.stat().st_size for f in run.rglob("*") if f.suffix in (".mcap", ".parquet"))
    return Car(
        rounds_cpu_s=tuple(_rounds_cpu_s(events, names, {row["round_id"] for row in settled})),
        start_s=_median_s(own, "start a round"),
        end_s=_median_s(own, "take a round apart"),
        latency_s=tuple(row["latency_ms"] / 1e3 for row in settled),
        orchestrator_cores=drive.shares["orchestrator"],
        others_cores=drive.others_cores,
        samples_per_s=len(taken) / seconds,
        sample_cpu_s=statistics.mean(taken),
        question_bytes=statistics.mean(len(row["job"]) for row in jobs),
        answer_bytes=statistics.mean(answers),
        telemetry_bytes_per_s=sent / seconds,
        recorded_bytes_per_s=on_disk / seconds,
    )


def _median_s(spans: list[dict[str, Any]], name: str) -> float:
    return statistics.median(float(e["tdur"]) / 1e6 for e in spans if e["name"] == name)


def _rounds_cpu_s(
    events: list[dict[str, Any]], names: dict[int, str], wanted: set[int]
) -> list[float]:
    """Return the CPU time of each wanted round's jobs."""
    ends = {e["id2"]["local"]: e["ts"] for e in events if e["ph"] == "e" and e["name"] == "round"}
    jobs = [
        e for e in events if e["ph"] == "X" and e["name"] == "job" and names[e["pid"]][:1] == "w"
    ]
    at = np.array([job["ts"] for job in jobs])
    cpu = np.array([job["tdur"] for job in jobs]) / 1e6
    found = []
    for one in events:
        if one["ph"] == "b" and one["name"] == "round" and one["args"]["id"] in wanted:
            inside = (at >= one["ts"]) & (at <= ends[one["id2"]["local"]])
            if inside.any():
                found.append(float(cpu[inside].sum()))
    return found


def measure() -> Measured:
    """Measure everything; some ten minutes on two busy cores."""
    before = os.getloadavg()[0]
    with tempfile.TemporaryDirectory(prefix="scale-") as name:
        folder = Path(name)
        car = measure_car(folder / "car")
        runs, loads = measure_sweeps(folder)
        answers = [run.answer_bytes for run in runs if run.futures_per_job == 64]
        worlds = measure_worlds(folder, loads["64"])
        compiled_s = sum(run.parts_s["compile a World"] * len(run.jobs) for run in runs)
        compiled_s /= sum(job.compiled for run in runs for job in run.jobs)
        return Measured(
            day=datetime.datetime.now(datetime.UTC).date().isoformat(),
            processor=processor(),
            cores=os.cpu_count() or 1,
            load=(before, os.getloadavg()[0]),
            runs=tuple(runs),
            shapes={size: tuple(load.shapes.values()) for size, load in loads.items()},
            dispatched=tuple(measure_dispatch(count) for count in DISPATCH_WORKERS),
            worlds=msgspec.structs.replace(worlds, compile_cpu_s=compiled_s),
            stored=measure_stored(loads["16"], loads["64"], statistics.mean(answers)),
            car=car,
        )
