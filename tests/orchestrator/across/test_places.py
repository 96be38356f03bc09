from __future__ import annotations

import shutil
from pathlib import Path

import pytest

from foretwin.contracts.errors import UserError
from foretwin.orchestrator.across.places import found_in, once
from foretwin.orchestrator.lake.collect import collect
from foretwin.orchestrator.lake.store import FolderStore
from tests.orchestrator.lake.made_runs import made_run, made_sweep


def test_runs_and_sweeps_are_found_in_order_of_time_and_others_passed_by(tmp_path: Path) -> None:
    later = made_run(tmp_path / "runs", day="20261124")
    first = made_run(tmp_path / "runs", day="20261122")
    sweep = made_sweep(tmp_path / "sweeps" / "town")
    (tmp_path / "notes").mkdir()
    (tmp_path / "notes" / "run.txt").touch()

    found = found_in([str(tmp_path)])

    assert [row.folder for row in found.rows if row.kind == "drive"] == [str(first), str(later)]
    assert str(sweep) in {row.folder for row in found.rows}
    assert len(found.rows) == 3


def test_without_a_place_the_usual_ones_are_looked_at(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    with pytest.raises(UserError, match="neither runs nor sweeps is here"):
        found_in([])
    made_run(Path("runs"))

    assert len(found_in([]).rows) == 1


def test_a_lake_is_known_by_its_manifest(tmp_path: Path) -> None:
    run = made_run(tmp_path / "runs")
    collect(FolderStore(tmp_path / "lake"), [run])

    found = found_in([str(tmp_path / "lake"), str(run)])

    assert list(found.lakes[0].manifest.runs) == [run.name]
    assert [row.run for row in found.rows] == [run.name]


def test_a_run_that_is_there_twice_counts_once_and_is_told(tmp_path: Path) -> None:
    run = made_run(tmp_path / "a")
    copied = Path(shutil.copytree(run, tmp_path / "b" / "copied"))

    found = found_in([str(run), str(run), str(copied)])

    assert found.doubled == [f"{copied}: is called {run.name} as {run} is: only the first is asked"]
    assert [row.folder for row in once(found.rows)] == [str(run)]
    assert [(row.folder, row.remark) for row in found.rows] == [
        (str(run), ""), (str(copied), f"called as {run} is"),
    ]  # fmt: skip


def test_a_folder_without_runs_is_refused(tmp_path: Path) -> None:
    with pytest.raises(UserError, match="neither a run nor a sweep"):
        found_in([str(tmp_path)])
    with pytest.raises(FileNotFoundError, match="no such folder"):
        found_in([str(tmp_path / "nowhere")])
