"""Sweeps on Ray: the same rows whatever happens to nodes, and an end whatever happens.

Needs root and RAY_VENV, an environment with foretwin[ray].
"""

from __future__ import annotations

import json
import re
import shutil
import signal
import subprocess
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from foretwin.orchestrator.commands.cli import run
from tests.log_lines import read_log
from tests.orchestrator.sweeps import SMALL, small_sweep
from tests.sim_worker.planners.installed import install
from tests.system.ray_nodes import RAY_DEADLINE_S, RayNodes

pytestmark = [pytest.mark.judge, pytest.mark.timeout(1200)]

TOWN = """
map = "orchestrator/embedded/drawn_town.osm"
scenarios = ["scp", "ccftap", "cpta"]
cases = 12
planners = ["pure_pursuit_idm", "constant_speed", "gap_acceptance"]
horizon_s = 5.0
metrics = ["ttc", "driving_score"]

[parameters]
friction_factor = [1.0, 0.8, 0.6, 0.4]
target_speed_factor = [0.8, 1.0]
"""
SWEEP = ("-m", "foretwin", "sweep")


@pytest.fixture(scope="module")
def nodes() -> Iterator[RayNodes]:
    """Three nodes of one processor each; who takes one away starts it again."""
    with RayNodes(4) as nodes:
        for number in range(3):
            nodes.start(number)
        yield nodes


@pytest.fixture(scope="module")
def town(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, dict[str, Any]]:
    """A spec of some dozens of jobs, and its summary by worker processes of this machine."""
    folder = tmp_path_factory.mktemp("town")
    spec = folder / "town.toml"
    spec.write_text(TOWN)
    assert run(["sweep", str(spec), "--out", str(folder / "zenoh")]) == 0
    found = summary(folder / "zenoh")
    assert found["jobs"] >= 20
    return spec, found


def summary(out: Path) -> dict[str, Any]:
    return json.loads((out / "sweep.json").read_text())


def on(nodes: RayNodes, spec: Path, out: Path, *more: str) -> tuple[str, ...]:
    where = ("--engine", "ray", "--address", nodes.address)
    return (*SWEEP, str(spec), "--out", str(out), *where, *more)


def wait_for_jobs(out: Path, count: int, process: subprocess.Popen[str]) -> None:
    """Wait until so many jobs are done, and not all."""
    until_s = time.monotonic() + RAY_DEADLINE_S
    while len(list((out / "rows").glob("*.parquet"))) < count:
        assert process.poll() is None, process.communicate()
        assert time.monotonic() < until_s
        time.sleep(0.02)


def test_one_node_gives_the_rows_that_processes_of_this_machine_give(
    town: tuple[Path, dict[str, Any]], tmp_path: Path
) -> None:
    spec, by_processes = town
    with RayNodes(1) as alone:
        alone.start(0)
        ended = alone.run(*on(alone, spec, tmp_path / "out"))
    assert ended.returncode == 0, ended.stderr
    assert summary(tmp_path / "out")["rows_sha256"] == by_processes["rows_sha256"]


def test_of_three_nodes_one_dies_in_the_middle_and_nothing_is_lost(
    nodes: RayNodes, town: tuple[Path, dict[str, Any]], tmp_path: Path
) -> None:
    spec, by_processes = town
    with nodes.started(*on(nodes, spec, tmp_path, "--json")) as process:
        wait_for_jobs(tmp_path, 6, process)
        nodes.kill(2)
        killed_s = time.monotonic()
        screen, _ = process.communicate(timeout=RAY_DEADLINE_S)
    nodes.start(2)
    found = json.loads(screen)  # and what Ray says of its node is not among it
    assert process.returncode == 0
    assert found["rows_sha256"] == by_processes["rows_sha256"]
    jobs = found["jobs"]
    assert found["ledger"]["jobs"] == {"given": jobs, "results": jobs, "refused": 0, "lost": 0}
    print(f"ended {time.monotonic() - killed_s:.1f} s after a node was killed")


def test_a_node_that_is_cut_off_holds_nobody_up_for_ever(
    nodes: RayNodes, town: tuple[Path, dict[str, Any]], tmp_path: Path
) -> None:
    spec, by_processes = town
    with nodes.started(*on(nodes, spec, tmp_path, "--json")) as process:
        wait_for_jobs(tmp_path, 6, process)
        nodes.cut(1)
        cut_s = time.monotonic()
        screen, _ = process.communicate(timeout=RAY_DEADLINE_S)
    print(f"ended {time.monotonic() - cut_s:.1f} s after a node was cut off")
    nodes.kill(1)
    nodes.cut(1, mended=True)
    nodes.start(1)
    assert process.returncode == 0
    assert json.loads(screen)["rows_sha256"] == by_processes["rows_sha256"]


def test_a_driver_that_is_killed_goes_on_where_it_was(
    nodes: RayNodes, town: tuple[Path, dict[str, Any]], tmp_path: Path
) -> None:
    spec, by_processes = town
    with nodes.started(*on(nodes, spec, tmp_path)) as process:
        wait_for_jobs(tmp_path, 6, process)
        process.kill()
    ended = nodes.run(*on(nodes, spec, tmp_path, "--json"))
    found = json.loads(ended.stdout)
    assert 0 < found["jobs_played"] <= found["jobs"] - 6
    assert found["rows_sha256"] == by_processes["rows_sha256"]
    assert found["ledger"]["jobs"]["given"] == found["jobs_played"]


def test_the_head_takes_its_driver_along_and_another_cluster_goes_on(
    town: tuple[Path, dict[str, Any]], tmp_path: Path
) -> None:
    spec, by_processes = town
    with RayNodes(1) as first:
        first.start(0)
        with first.started(*on(first, spec, tmp_path)) as process:
            wait_for_jobs(tmp_path, 3, process)
            first.kill(0)
            killed_s = time.monotonic()
            process.communicate(timeout=RAY_DEADLINE_S)
            assert process.returncode != 0
            print(f"the driver ended {time.monotonic() - killed_s:.1f} s after its node")
    with RayNodes(1) as second:
        second.start(0)
        ended = second.run(*on(second, spec, tmp_path, "--json"))
    found = json.loads(ended.stdout)
    assert 0 < found["jobs_played"] < found["jobs"]
    assert found["rows_sha256"] == by_processes["rows_sha256"]


@pytest.mark.parametrize("sig", [signal.SIGINT, signal.SIGTERM])
def test_who_ends_it_ends_it_soon_as_any_sweep(
    nodes: RayNodes, town: tuple[Path, dict[str, Any]], tmp_path: Path, sig: signal.Signals
) -> None:
    spec, _ = town
    with nodes.started(*on(nodes, spec, tmp_path)) as process:
        wait_for_jobs(tmp_path, 3, process)
        process.send_signal(sig)
        _, told = process.communicate(timeout=RAY_DEADLINE_S)
    assert process.returncode == 130
    assert "Traceback" not in told


def test_two_sweeps_at_once_count_each_its_own(
    nodes: RayNodes, town: tuple[Path, dict[str, Any]], tmp_path: Path
) -> None:
    spec, by_processes = town
    small = small_sweep(tmp_path)
    with (
        nodes.started(*on(nodes, spec, tmp_path / "town", "--json")) as one,
        nodes.started(*on(nodes, small, tmp_path / "small", "--json", "--workers", "1")) as other,
    ):
        ended = [process.communicate(timeout=RAY_DEADLINE_S) for process in (one, other)]
    assert (one.returncode, other.returncode) == (0, 0), ended
    of_town, of_small = (json.loads(screen) for screen, _ in ended)
    assert of_town["rows_sha256"] == by_processes["rows_sha256"]
    assert run(["sweep", str(small), "--out", str(tmp_path / "zenoh"), "--workers", "1"]) == 0
    assert of_small["rows_sha256"] == summary(tmp_path / "zenoh")["rows_sha256"]
    for found in of_town, of_small:
        jobs = found["jobs"]
        assert found["ledger"]["jobs"] == {"given": jobs, "results": jobs, "refused": 0, "lost": 0}


def test_a_node_of_another_version_is_told_in_one_line_and_nothing_is_lost(
    nodes: RayNodes, tmp_path: Path
) -> None:
    lying = tmp_path / "lying" / "numpy-1.0.dist-info"
    lying.mkdir(parents=True)
    (lying / "METADATA").write_text("Metadata-Version: 2.1\nName: numpy\nVersion: 1.0\n")
    small = small_sweep(tmp_path)
    with RayNodes(2) as mixed:
        mixed.start(0, processors=0)
        mixed.start(1, before_path=tmp_path / "lying")
        ended = mixed.run(*on(mixed, small, tmp_path / "out"))
    assert ended.returncode == 2
    (line,) = [one for one in ended.stderr.splitlines() if one.startswith("foretwin: ")]
    assert re.search(r"has numpy 1\.0 instead of 2\S+: install there what is installed here", line)
    assert "Traceback" not in ended.stderr
    assert nodes.run(*on(nodes, small, tmp_path / "out")).returncode == 0


PLANNER = """
import os, time
from foretwin.sim_worker.planner_interface import PlannerOutput

class Fatal:
    def plan(self, view):
        os._exit(7)

class Endless:
    def plan(self, view):
        while True:
            pass
"""


def test_jobs_that_nobody_survives_cost_themselves_alone(nodes: RayNodes, tmp_path: Path) -> None:
    crashing = tmp_path / "plugins"
    crashing.mkdir()
    install(crashing, "bad_planners", PLANNER, fatal="Fatal", endless="Endless")
    text = SMALL.replace('"scp", "cpta", "reversing_parking"', '"scp"')
    text = text.replace('"constant_speed"]', '"fatal", "endless"]')
    small = small_sweep(tmp_path, "job_timeout_s = 8.0\n" + text)
    with RayNodes(1, processors=2) as own:
        own.start(0, before_path=crashing)
        ended = own.run(*on(own, small, tmp_path / "out", "--json"), before_path=crashing)
    assert ended.returncode == 3, ended.stderr
    found = json.loads(ended.stdout)
    by_planner = {entry["planner"]: entry for entry in found["scenarios"]}
    assert by_planner["pure_pursuit_idm"]["failed"] == 0
    for planner in "fatal", "endless":
        assert by_planner[planner]["failed"] == by_planner[planner]["cases"]
    print({name: entry["reasons"] for name, entry in by_planner.items()})


def test_a_cluster_of_its_own_needs_no_address(town: tuple[Path, dict[str, Any]]) -> None:
    spec, by_processes = town
    out = spec.parent / "local"
    with RayNodes(1) as machine:
        options = (*SWEEP, str(spec), "--out", str(out), "--engine", "ray", "--workers", "2")
        ended = machine.run(*options, "--json")
    assert ended.returncode == 0, ended.stderr
    assert json.loads(ended.stdout)["rows_sha256"] == by_processes["rows_sha256"]
    shutil.rmtree(out)


def test_somebody_else_at_the_address_is_told_in_one_line(nodes: RayNodes, tmp_path: Path) -> None:
    listens = "import socket, time; s = socket.create_server(('10.77.0.4', 6379)); time.sleep(600)"
    small = small_sweep(tmp_path)
    with nodes.started("-c", listens, on=3) as other:
        nodes.run("-c", "import time; time.sleep(1)")
        address = f"{nodes.ip(3)}:6379"
        ended = nodes.run(
            *SWEEP, str(small), "--out", str(tmp_path / "out"), "--engine", "ray",
            "--address", address,
        )  # fmt: skip
        other.kill()
    assert ended.returncode == 2, ended.stderr
    assert f"--address {address}: " in ended.stderr
    assert not (tmp_path / "out").exists()


def test_what_ray_says_of_its_nodes_is_in_the_log_of_the_sweep(
    nodes: RayNodes, town: tuple[Path, dict[str, Any]], tmp_path: Path
) -> None:
    spec, _ = town
    with nodes.started(*on(nodes, spec, tmp_path)) as process:
        wait_for_jobs(tmp_path, 3, process)
        nodes.kill(2)
        process.communicate(timeout=RAY_DEADLINE_S)
    nodes.start(2)
    lines = read_log(tmp_path / "log.jsonl").lines if (tmp_path / "log.jsonl").exists() else []
    print([line["text"] for line in lines])
