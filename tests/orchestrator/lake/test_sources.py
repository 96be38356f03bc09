from __future__ import annotations

import json
import os
from pathlib import Path

import pytest

from foretwin.contracts.errors import UserError
from foretwin.orchestrator.lake.sources import SourceTables, source_of
from foretwin.orchestrator.record.folders_of_runs import folders_of_runs
from foretwin.world_gen.world_store import WorldStore
from tests.orchestrator.lake.made_runs import CREDIT, made_run, made_sweep
from tests.sim_worker.scenarios.worlds import cross


def test_a_folder_of_runs_stands_for_all_of_them(tmp_path: Path) -> None:
    runs = [made_run(tmp_path, number) for number in (2, 1)]
    (tmp_path / "notes").mkdir()

    assert folders_of_runs(tmp_path) == sorted(runs)
    assert folders_of_runs(runs[0]) == [runs[0]]


def test_what_is_no_run_is_told(tmp_path: Path) -> None:
    with pytest.raises(UserError, match="neither a run nor a sweep, nor a folder of these"):
        folders_of_runs(tmp_path)
    with pytest.raises(FileNotFoundError, match="no such folder"):
        folders_of_runs(tmp_path / "nowhere")


def test_the_hash_of_a_run_is_that_of_its_record_and_every_table(tmp_path: Path) -> None:
    run = made_run(tmp_path)
    before = source_of(run).sha256
    (run / "monitor.rrd").write_bytes(b"a recording is not collected")
    assert source_of(run).sha256 == before
    record = json.loads((run / "run.json").read_text())

    (run / "run.json").write_text(json.dumps(record | {"exit": "recovered"}))

    assert source_of(run).sha256 != before


def test_every_table_names_its_run_and_runs_tell_where_the_rest_is(tmp_path: Path) -> None:
    run = made_run(tmp_path, futures=3, drive_time_s=2.5)
    (run / "drive.mcap").write_bytes(bytes(100))
    tables = SourceTables(source_of(run))

    (futures,) = tables.batches("futures")
    (row,) = [row for batch in tables.batches("runs") for row in batch.to_pylist()]

    assert futures.schema.names[0] == "run_id"
    assert futures["run_id"].to_pylist() == 3 * [run.name]
    assert set(tables.schemas) == {"runs", "futures", "rounds"}  # the others have no row
    assert tables.rows == {"runs": 1, "futures": 3, "rounds": 1}
    assert (row["run_id"], row["kind"], row["exit"]) == (run.name, "drive", "completed")
    assert (row["drive_time_s"], row["recordings_bytes"]) == (2.5, 100)
    assert (row["folder"], row["attribution"]) == (str(run), CREDIT)
    assert json.loads(row["record"])["config"] == {"vehicle_id": "ego"}


def test_a_drive_that_is_called_otherwise_belongs_to_the_day_of_its_record(tmp_path: Path) -> None:
    run = made_run(tmp_path, run_id="mine")
    noon_s = 1_795_434_000
    os.utime(run / "run.json", (noon_s, noon_s))

    partition = SourceTables(source_of(run)).partition

    assert (partition.day, partition.vehicle) == ("2026-11-23", "ego")


def test_the_map_of_a_sweep_is_that_of_its_worlds(tmp_path: Path) -> None:
    sweep = made_sweep(tmp_path / "sweep")
    WorldStore(sweep / "worlds").save(cross())
    assert SourceTables(source_of(sweep)).partition.map == "none"  # of given Worlds
    record = json.loads((sweep / "sweep.json").read_text())

    (sweep / "sweep.json").write_text(json.dumps(record | {"spec": {"map": "town.osm"}}))

    assert SourceTables(source_of(sweep)).partition.map == f"osm-{cross().map_sha256[:12]}"


@pytest.mark.parametrize(("text", "told"), [("{", "cannot be read"), ("[]", "is no record")])
def test_a_record_that_cannot_be_read_is_told(tmp_path: Path, text: str, told: str) -> None:
    run = made_run(tmp_path)
    (run / "run.json").write_text(text)

    with pytest.raises(UserError, match=told):
        source_of(run)


def test_a_folder_without_record_or_tables_is_told(tmp_path: Path) -> None:
    with pytest.raises(UserError, match=r"holds no run\.json"):
        source_of(tmp_path)
    (tmp_path / "run.json").write_text("{}")
    with pytest.raises(UserError, match="holds no tables"):
        source_of(tmp_path)
