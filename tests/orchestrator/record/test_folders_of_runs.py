from __future__ import annotations

from pathlib import Path

import pytest

from foretwin.contracts.errors import UserError
from foretwin.orchestrator.record.folders_of_runs import folders_of_runs, table_files
from tests.orchestrator.lake.made_runs import made_run, made_sweep


def test_runs_are_found_in_a_folder_and_one_deeper(tmp_path: Path) -> None:
    run, sweep = made_run(tmp_path / "runs"), made_sweep(tmp_path / "sweep")
    made_run(run / "judged")  # of the run, not of the folder
    made_run(tmp_path / "too" / "deep" / "down")

    assert folders_of_runs(tmp_path) == [run, sweep]
    assert folders_of_runs(run) == [run]


def test_a_folder_without_runs_is_refused(tmp_path: Path) -> None:
    with pytest.raises(UserError, match="neither a run nor a sweep"):
        folders_of_runs(tmp_path)


def test_parts_of_a_table_come_in_the_order_in_which_they_were_written(tmp_path: Path) -> None:
    run = made_run(tmp_path)
    for number in (1000, 2, 999):
        (run / "results" / f"futures-{number:03d}.parquet").touch()

    files = table_files(run)

    assert [path.stem for path in files["futures"]] == [
        "futures-002", "futures-999", "futures-1000", "futures",
    ]  # fmt: skip
    assert "futures-002" not in files


def test_the_tables_of_a_sweep_are_folders(tmp_path: Path) -> None:
    files = table_files(made_sweep(tmp_path / "sweep", jobs=2))

    assert [path.name for path in files["futures"]] == ["job-000000.parquet", "job-000001.parquet"]
    assert [path.name for path in files["metrics"]] == ["metrics.parquet"]
    assert "road_users" not in files
