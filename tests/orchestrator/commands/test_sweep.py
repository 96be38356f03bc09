"""Sweeps from the command line: the same rows however they are computed, and on from a stop."""

from __future__ import annotations

import contextlib
import functools
import json
import os
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import pyarrow.parquet as pq
import pytest

from foretwin.contracts.world import ATTRIBUTION
from foretwin.orchestrator.commands.cli import run
from foretwin.orchestrator.commands.sweep import run_sweep
from foretwin.orchestrator.embedded import MAP_FILE
from foretwin.orchestrator.runner import worker_processes
from foretwin.orchestrator.sweep.engines import Engine, workers_for
from foretwin.orchestrator.sweep.spec import load_spec
from foretwin.sim_worker.futures.job_tables import JOB_TABLES
from tests.orchestrator.sweeps import SMALL, alone, small_sweep
from tests.sim_worker.planners.installed import install
from tests.starvation import kept_waiting

COVERS = (
    "foretwin.orchestrator.commands.cli_sweep",
    "foretwin.orchestrator.sweep.folder",
    "foretwin.orchestrator.sweep.jobs",
    "foretwin.orchestrator.sweep.workers",
)

ENDS_WITHIN_S = 3.0
STARTS_WITHIN_S = 120.0


@pytest.fixture(scope="module")
def swept(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, dict[str, Any]]:
    """A small sweep's folder, played in this process, and what it came to."""
    folder = tmp_path_factory.mktemp("swept")
    loaded = load_spec(small_sweep(folder))
    return folder, run_sweep(loaded, folder / "out", alone(loaded))


def _rows(out: Path) -> list[dict[str, Any]]:
    table = pq.read_table(out / "rows")
    return sorted(table.to_pylist(), key=lambda row: row["cell"])


def test_a_row_tells_everything_about_its_cell(swept: tuple[Path, dict[str, Any]]) -> None:
    folder, summary = swept
    rows = _rows(folder / "out")
    assert len(rows) == summary["rows"] == 2 * 2 * (2 + 2 + 1)
    assert [row["cell"] for row in rows] == list(range(len(rows)))
    assert list(rows[0]) == JOB_TABLES["futures"].names
    crash = next(
        row for row in rows
        if (row["scenario"], row["planner"], row["friction_factor"])
        == ("scp", "constant_speed", 1.0)
    )  # fmt: skip
    assert crash["collided"]
    assert crash["collision_with"] == "road_user"
    assert crash["planned_impact_off_m"] < 0.1
    assert crash["accident_time_s"] == pytest.approx(crash["planned_impact_time_s"], abs=0.03)
    assert crash["accident_with"] == crash["planned_impact_with"]
    assert crash["metric_driving_score"] == 0.0
    assert len(crash["trajectory_sha256"]) == 64
    assert dict(crash["values"])["ego.speed_mps"] > 0.0
    backwards = [row for row in rows if row["scenario"] == "reversing_parking"]
    assert {row["planner"] for row in backwards} == {"reverse_pursuit"}
    assert all(row["valid"] and row["progress_m"] > 2.0 for row in backwards)


def test_the_summary_counts_by_scenario_and_planner(swept: tuple[Path, dict[str, Any]]) -> None:
    folder, summary = swept
    assert summary["failed"] == 0
    assert summary["placed"] == summary["rows"]
    entry = {(e["scenario"], e["planner"]): e for e in summary["scenarios"]}
    assert entry["scp", "constant_speed"]["collided"] == 4
    assert entry["scp", "pure_pursuit_idm"]["cases"] == 4
    written = json.loads((folder / "out" / "sweep.json").read_text())
    assert written["rows_sha256"] == summary["rows_sha256"]
    assert written["complete"] is True
    assert written["spec"]["cases"] == 2


def test_whose_map_it_is_stands_in_the_summary_and_in_every_table(
    swept: tuple[Path, dict[str, Any]],
) -> None:
    folder, summary = swept
    assert summary["attribution"] == ATTRIBUTION
    for table in sorted((folder / "out").rglob("*.parquet")):
        assert pq.read_schema(table).metadata[b"attribution"].decode() == ATTRIBUTION, table


def test_two_workers_give_the_same_rows_again_and_again(
    swept: tuple[Path, dict[str, Any]], tmp_path: Path
) -> None:
    folder, summary = swept
    loaded = load_spec(folder / "small.toml")
    with workers_for(loaded, tmp_path, Engine(workers=2)) as runner:
        for _ in range(2):
            again = run_sweep(loaded, tmp_path, runner, fresh=True)
            assert again["jobs_played"] == summary["jobs"]
            assert again["rows_sha256"] == summary["rows_sha256"]


def test_a_second_start_plays_only_what_is_missing(
    swept: tuple[Path, dict[str, Any]], capsys: pytest.CaptureFixture[str]
) -> None:
    folder, summary = swept
    out = folder / "out"
    parts = sorted((out / "rows").glob("*.parquet"))
    parts[1].unlink()
    parts[2].write_bytes(parts[2].read_bytes()[:100])
    (out / "rows" / "job-000000.writing").write_bytes(b"half")
    assert (
        run(["sweep", str(folder / "small.toml"), "--out", str(out), "--workers", "1", "--json"])
        == 0
    )
    again = json.loads(capsys.readouterr().out)
    assert again["jobs_played"] == 2
    assert again["rows_sha256"] == summary["rows_sha256"]
    assert not list(out.rglob("*.writing"))


def test_another_spec_is_refused_in_the_same_folder(
    swept: tuple[Path, dict[str, Any]], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder, _ = swept
    other = small_sweep(tmp_path, SMALL.replace("cases = 2", "cases = 1"))
    assert run(["sweep", str(other), "--out", str(folder / "out")]) == 2
    assert "--fresh starts anew" in capsys.readouterr().err


def test_a_sweep_that_plays_nothing_says_which_scenarios_apply_nowhere(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    text = SMALL.replace(
        '"scp", "cpta", "reversing_parking"', '"roundabout_entry", "race_track_lap"'
    )
    spec, out = small_sweep(tmp_path, text), tmp_path / "out"
    assert run(["sweep", str(spec), "--out", str(out), "--workers", "1"]) == 3
    said = capsys.readouterr().out
    assert "placed nowhere: race_track_lap, roundabout_entry\n" in said
    assert "0 rows of 1 Worlds" in said
    written = json.loads((out / "sweep.json").read_text())
    assert written["placed_nowhere"] == ["race_track_lap", "roundabout_entry"]


PLANNER = """
from foretwin.sim_worker.planner_interface import PlannerOutput

class Rolling:
    def plan(self, view):
        return PlannerOutput({accel_mps2} + 0.0 * view.arc_m, 0.0 * view.arc_m)
"""


@pytest.mark.judge
def test_a_changed_planner_does_not_get_the_rows_of_the_old_one(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    install(tmp_path, "changed_planner", PLANNER.format(accel_mps2=0.0), rolling="Rolling")
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))  # for workers
    rolling = SMALL.replace('"pure_pursuit_idm", "constant_speed"', '"rolling"')
    spec, out = small_sweep(tmp_path, rolling), str(tmp_path / "out")
    request = ["sweep", str(spec), "--out", out, "--workers", "1", "--json"]
    assert run(request) == 0
    first = json.loads(capsys.readouterr().out)
    assert first["planners"]["rolling"]["distribution"] == "changed_planner"
    assert run(request) == 0
    assert json.loads(capsys.readouterr().out)["jobs_played"] == 0

    (tmp_path / "changed_planner.py").write_text(PLANNER.format(accel_mps2=-4.0))
    assert run(request) == 2
    assert "another spec, map, planner or version" in capsys.readouterr().err
    assert run([*request, "--fresh"]) == 0
    again = json.loads(capsys.readouterr().out)
    assert again["jobs_played"] == first["jobs_played"] > 0
    assert again["rows_sha256"] != first["rows_sha256"]


def _ended_by(sig: signal.Signals, spec: Path, out: Path) -> None:
    """Start a sweep with one worker and end it by a signal after its first job: it ends soon, says
    so, and leaves no other files behind; by SIGKILL it says nothing, and all is left."""
    temporary = spec.parent / "temporary"
    temporary.mkdir()
    process = subprocess.Popen(
        [sys.executable, "-P", "-m", "foretwin", "sweep", str(spec), "--out", str(out),
         "--workers", "1"],
        cwd=Path(__file__).parents[3], stderr=subprocess.PIPE, text=True,
        env=os.environ | {"TMPDIR": str(temporary)},
    )  # fmt: skip
    try:
        deadline = time.monotonic() + STARTS_WITHIN_S
        while not list(out.glob("rows/*.parquet")) and time.monotonic() < deadline:
            assert process.poll() is None
            with contextlib.suppress(subprocess.TimeoutExpired):
                process.wait(0.05)
        pressed_s = time.monotonic()
        with kept_waiting(process.pid) as kept:
            process.send_signal(sig)
            _, said = process.communicate(timeout=STARTS_WITHIN_S)
        assert time.monotonic() - pressed_s - kept.seconds < ENDS_WITHIN_S
    finally:
        if process.poll() is None:
            process.kill()
            process.wait()
    if sig == signal.SIGKILL:
        assert list(temporary.iterdir())
        return
    assert process.returncode == 130
    assert said.endswith("foretwin: interrupted\n")
    assert "Traceback" not in said
    assert list(temporary.iterdir()) == []


def _long_sweep(folder: Path) -> Path:
    """Seconds of work: a smaller sweep is done before a busy machine has pressed the key."""
    frictions = str([round(0.4 + 0.01 * k, 2) for k in range(40)])
    text = SMALL.replace('"pure_pursuit_idm", ', "")
    return small_sweep(folder, text.replace("[1.0, 0.4]", frictions))


def test_ctrl_c_ends_soon_and_keeps_what_is_done(tmp_path: Path) -> None:
    spec = _long_sweep(tmp_path)
    loaded, out = load_spec(spec), tmp_path / "out"
    _ended_by(signal.SIGINT, spec, out)
    kept = list((out / "rows").glob("*.parquet"))
    assert kept
    assert not json.loads((out / "sweep.json").read_text())["complete"]
    again = run_sweep(loaded, out, alone(loaded))
    whole = run_sweep(loaded, tmp_path / "whole", alone(loaded))
    assert again["jobs_played"] <= whole["jobs"] - len(kept)
    assert again["rows_sha256"] == whole["rows_sha256"]


@pytest.mark.judge
@pytest.mark.parametrize("sig", [signal.SIGTERM, signal.SIGHUP])
def test_a_sweep_that_is_told_to_end_ends_as_by_ctrl_c(tmp_path: Path, sig: signal.Signals) -> None:
    _ended_by(sig, _long_sweep(tmp_path), tmp_path / "out")


def test_workers_that_cannot_be_started_are_told_in_one_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    start = functools.partial(worker_processes.FreshInterpreter, package="no_such_package")
    monkeypatch.setattr(worker_processes, "FreshInterpreter", start)
    assert run(["sweep", str(small_sweep(tmp_path)), "--out", str(tmp_path / "out")]) == 3
    said = capsys.readouterr().err
    log = tmp_path / "out" / "log.jsonl"
    assert said == f"foretwin: no worker can be started; see {log}; what is done is kept\n"
    assert "no_such_package" in log.read_text()


def test_what_a_killed_sweep_left_goes_as_the_next_one_begins(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path / "temporary"))
    spec, out = _long_sweep(tmp_path), tmp_path / "out"
    _ended_by(signal.SIGKILL, spec, out)
    buses = tmp_path / "foretwin"
    left = {*(tmp_path / "temporary").iterdir(), *buses.iterdir()}
    with workers_for(load_spec(spec), out, Engine(workers=1)):
        assert not any(folder.exists() for folder in left)
    assert [*(tmp_path / "temporary").iterdir(), *buses.iterdir()] == []


@pytest.mark.judge
@pytest.mark.timeout(5400)
@pytest.mark.parametrize("workers", [1, 2, 4])
def test_100_of_100_runs_give_the_same_hash(
    swept: tuple[Path, dict[str, Any]], tmp_path: Path, workers: int
) -> None:
    folder, summary = swept
    loaded = load_spec(folder / "small.toml")
    hashes = []
    with workers_for(loaded, tmp_path, Engine(workers=workers)) as runner:
        for number in range(100):
            if number % 25 == 10 and runner.pids:
                os.kill(runner.pids[0], signal.SIGKILL)
            hashes.append(run_sweep(loaded, tmp_path, runner, fresh=True)["rows_sha256"])
    assert hashes == 100 * [summary["rows_sha256"]]


@pytest.mark.parametrize("wrong", ['junctions = ["n999"]', 'bbox = "13,52,14,53"'])
def test_a_sweep_that_cannot_begin_leaves_no_folder(wrong: str, tmp_path: Path) -> None:
    spec = tmp_path / "wrong.toml"
    spec.write_text(f'map = "{MAP_FILE}"\n{wrong}\n')
    assert run(["sweep", str(spec), "--out", str(tmp_path / "out")]) == 2
    assert not (tmp_path / "out").exists()
