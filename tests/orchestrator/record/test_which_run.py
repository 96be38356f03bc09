"""Which run is meant, by `view` and `set` alike."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from foretwin.contracts.errors import UserError
from foretwin.orchestrator.commands.cli import EXIT_USER, run
from foretwin.orchestrator.record.which_run import run_folder, runs_below


@pytest.fixture
def runs(tmp_path: Path) -> Path:
    for name in ("20261121-100000-aaaa", "20261121-110000-bbbb"):
        (tmp_path / name).mkdir()
        record = json.dumps({"run_id": name, "exit": "completed"})
        (tmp_path / name / "run.json").write_text(record)
    (tmp_path / "20261121-120000-cccc").mkdir()
    (tmp_path / "notes.txt").write_text("no run")
    return tmp_path


def test_a_run_is_named_by_its_folder_its_id_or_as_the_latest(runs: Path) -> None:
    first, newest = runs / "20261121-100000-aaaa", runs / "20261121-110000-bbbb"
    assert run_folder(first, Path("elsewhere")) == first
    assert run_folder(first.name, runs) == first
    assert run_folder("latest", runs) == newest
    assert runs_below(runs) == [newest, first]


@pytest.mark.parametrize(
    ("name", "told"),
    [
        ("none", "none: no such folder, and {} holds no run of that name; latest there is 2026"),
        ("20261121-120000-cccc", "cccc: no folder of a run (run.json is missing or torn)"),
    ],
)
def test_view_and_set_tell_alike_what_is_no_run(
    runs: Path, capsys: pytest.CaptureFixture[str], name: str, told: str
) -> None:
    said = []
    for asked in (["view", name], ["set", "role.ego=twin", "--run", name]):
        assert run([*asked, "--out", str(runs)]) == EXIT_USER
        said += capsys.readouterr().err.splitlines()
    assert said[0] == said[1]
    assert told.format(runs) in said[0]


def test_without_any_run_there_is_no_latest(tmp_path: Path) -> None:
    for out in (tmp_path, tmp_path / "none"):
        with pytest.raises(UserError, match="no run is there; --out names the folder of others"):
            run_folder("latest", out)
