from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from foretwin.orchestrator.across.run_rows import row_of_folder, sweep_row
from foretwin.orchestrator.record.run_state import RunGoesOnError, run_lock
from foretwin.orchestrator.sweep.lock import folder_lock
from foretwin.world_gen.world_store import WorldStore
from tests.orchestrator.lake.made_runs import made_run, made_sweep
from tests.sim_worker.scenarios.worlds import cross


def test_a_drive_is_told_by_its_record(tmp_path: Path) -> None:
    config = {"vehicle_id": "ego", "log": "/logs/monday.mcap", "planner": "mine",
              "start_s": 20.0}  # fmt: skip
    more: dict[str, Any] = {"config": config, "drive_time_s": 61.5, "intersections": [{}, {}],
            "left_out": {"intersections": 3},
            "tuning": {"verdicts": [{"culprit": "vehicle", "cause": "steering"}] * 2},
            "troubles": ["one row is lost"]}  # fmt: skip

    run = made_run(tmp_path, 7, **more)
    record = json.loads((run / "run.json").read_text())
    record["futures"] = {"count": 64, "late_rounds": 1}
    (run / "run.json").write_text(json.dumps(record))

    row = row_of_folder(run)

    assert (row.run, row.time) == ("20261123-000007-abcd", "2026-11-23 00:00:07")
    assert (row.kind, row.state, row.what, row.map) == (
        "drive", "completed", "log monday.mcap", "town.osm",
    )  # fmt: skip
    assert (row.planner, row.drive_time_s, row.junctions, row.seed) == ("mine", 61.5, 5, 7)
    assert row.driven_s == 41.5
    assert (row.futures, row.rounds_late, row.troubles) == (64, 1, 1)
    assert row.verdict == "vehicle: steering"
    assert json.loads(row.record)["drive_time_s"] == 61.5


def test_a_sweep_is_told_by_its_record(tmp_path: Path) -> None:
    spec = {"map": "maps/town.osm", "scenarios": ["scp"], "planners": ["a", "b"], "seed": 3,
            "vehicles": ["bmw_320i"]}  # fmt: skip
    told = {"spec": spec, "rows": 40, "placed": 34, "played": 33, "collided": 12, "failed": 1,
            "worlds": 4, "failures": {}, "playing_s": 2.5}  # fmt: skip

    sweep = made_sweep(tmp_path / "sweep", **told)
    assert row_of_folder(sweep).map_sha256 is None
    WorldStore(sweep / "worlds").save(cross())

    row = row_of_folder(sweep)

    assert row.map_sha256 == cross().map_sha256
    assert (row.run, row.kind, row.state) == ("sweep-0cdb5ed7a3db79d9", "sweep", "completed")
    assert (row.what, row.planner, row.map, row.futures) == ("scp", "a, b", "town.osm", 40)
    assert row.verdict == "12 of 33 collided, 1 failed"
    assert (row.junctions, row.collided, row.troubles, row.wall_s) == (4, 12, 1, 2.5)
    assert row.time is not None


@pytest.mark.parametrize(
    ("jobs_played", "more", "wall_s"),
    [(22, {}, 2.5), (0, {}, None), (9, {}, None), (0, {"shards": 3}, 2.5)],
)
def test_how_long_a_sweep_took_is_unknown_where_it_went_on(
    jobs_played: int, more: dict[str, int], wall_s: float | None
) -> None:
    told = {"jobs": 22, "jobs_played": jobs_played, "playing_s": 2.5, **more}
    row = sweep_row({"fingerprint": "0cdb", **told}, folder="sweep", record_text="")
    assert row.wall_s == wall_s


def test_a_drive_that_has_not_ended_runs_or_was_killed(tmp_path: Path) -> None:
    run = made_run(tmp_path, exit="running")

    with run_lock(run):
        assert row_of_folder(run).state == "running"
        with pytest.raises(RunGoesOnError), run_lock(run):
            pass
    killed = row_of_folder(run)
    assert (killed.state, "foretwin recover" in killed.remark) == ("killed", True)


def test_a_drive_whose_tables_are_streams_yet_was_killed(tmp_path: Path) -> None:
    run = made_run(tmp_path)
    (run / "results" / "gaps.arrows").touch()

    assert row_of_folder(run).state == "killed"


def test_looking_makes_no_file(tmp_path: Path) -> None:
    run = made_run(tmp_path, exit="running")
    before = sorted(run.iterdir())

    row_of_folder(run)

    assert sorted(run.iterdir()) == before


def test_a_sweep_that_has_not_ended_runs_or_has_stopped(tmp_path: Path) -> None:
    sweep = made_sweep(tmp_path / "sweep", complete=False)

    with folder_lock(sweep):
        assert row_of_folder(sweep).state == "running"
    assert row_of_folder(sweep).state == "stopped"


def test_shards_of_a_sweep_have_names_of_their_own(tmp_path: Path) -> None:
    assert row_of_folder(made_sweep(tmp_path / "s", shard="1/3")).run.endswith("-1of3")


@pytest.mark.parametrize("text", ["", "{", "[]", "{}", '{"exit": "completed", "config": 7}'])
def test_a_record_that_is_damaged_or_foreign_is_a_remark(tmp_path: Path, text: str) -> None:
    run = made_run(tmp_path)
    (run / "run.json").write_text(text)

    row = row_of_folder(run)

    assert (row.run, row.state) == (run.name, "damaged")
    assert "run.json" in row.remark
    assert "\n" not in row.remark
