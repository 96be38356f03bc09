"""The sweep that is measured: junctions of the drawn town, in jobs of a wanted size."""

from __future__ import annotations

import json
import shutil
import statistics
from pathlib import Path

import msgspec
import pyarrow.parquet as pq

from foretwin.contracts.setup import WorkerSetup
from foretwin.orchestrator.commands.sweep import run_sweep
from foretwin.orchestrator.embedded import MAP_FILE
from foretwin.orchestrator.runner.worker_processes import WorkerProcesses
from foretwin.orchestrator.sweep.spec import Loaded, load_spec
from foretwin.orchestrator.sweep.workers import worker_setup

_SPEC = """
map = "{map}"
sample = 4
cases = 8
scenarios = ["ccftap", "scp", "ltap_od"]
planners = ["pure_pursuit_idm", "constant_speed", "gap_acceptance"]
vehicles = {vehicles}
seed = 1

[parameters]
friction_factor = {frictions}
"""
CASES = 8
MANY_VEHICLES = ("bmw_320i", "ford_escort", "vw_vanagon")
"""A sweep of as many times more jobs."""
_FOUND = ("worlds", "places.msgpack", "vehicles", "sweep.json")
"""What a sweep's folder holds once its Worlds are built and its places found."""


class Workload:
    """A sweep in jobs of up to `futures_per_job` (a multiple of 8): each of its groups (a
    junction, a way, a planner) has as many futures, by as many frictions of the same cases."""

    def __init__(
        self, folder: Path, futures_per_job: int, vehicles: tuple[str, ...] = ("bmw_320i",)
    ) -> None:
        sets = futures_per_job // CASES
        self.vehicles, self.futures_per_job = len(vehicles), futures_per_job
        frictions = [round(1.0 - 0.5 * k / sets, 6) for k in range(sets)]
        self._folder = folder / f"{len(vehicles)}-jobs-of-{futures_per_job}"
        self._folder.mkdir(parents=True)
        spec = self._folder / "measured.toml"
        text = _SPEC.format(map=MAP_FILE, frictions=frictions, vehicles=json.dumps(vehicles))
        spec.write_text(text, encoding="utf-8")
        self.loaded: Loaded = load_spec(spec)
        self._played = self._folder / "first"
        traces = self._folder / "traces"
        setup = msgspec.structs.replace(self.setup(self._played), trace_dir=str(traces))
        files = self._folder / "files"
        with WorkerProcesses(2, setup, task_timeout_s=600.0, folder=files) as runner:
            self.summary = run_sweep(self.loaded, self._played, runner)
        events = [
            msgspec.json.decode(line)
            for file in traces.glob("*.trace")
            for line in file.read_bytes().splitlines()
        ]
        placed = [e["tdur"] / 1e6 for e in events if e["ph"] == "X" and e["name"] == "place"]
        self.place_cpu_s = statistics.mean(placed)
        self.shapes = _shapes(self._played)

    @property
    def futures(self) -> int:
        """Return how many there are."""
        return int(self.summary["rows"])

    @property
    def jobs(self) -> int:
        """Return in how many jobs they are."""
        return int(self.summary["jobs"])

    @property
    def played(self) -> Path:
        """Return the folder of the sweep that was played first, whole."""
        return self._played

    def unplayed(self, name: str) -> Path:
        """Return a folder in which all is found and nothing played."""
        out = self._folder / name
        out.mkdir()
        for kept in _FOUND:
            there = self._played / kept
            if there.is_dir():
                shutil.copytree(there, out / kept)
            else:
                shutil.copy2(there, out / kept)
        return out

    def setup(self, out: Path) -> WorkerSetup:
        """Return the setup of the workers that play into a folder."""
        return worker_setup(self.loaded, out)


def _shapes(out: Path) -> dict[str, tuple[str, int]]:
    """Return the World and futures of each job by its hash, in the order of the plan."""
    parts = sorted((out / "jobs").glob("*.parquet"))
    rows = [row for part in parts for row in pq.read_table(part).to_pylist()]
    rows.sort(key=lambda row: row["job_index"])
    return {row["job_sha256"]: (row["world_id"], row["futures"]) for row in rows}
