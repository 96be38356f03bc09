"""`foretwin set`: which drive it finds, and what is told in one line where it finds none."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from foretwin.contracts.joining import newest_running, running_drive
from foretwin.contracts.ports import free_endpoint, free_port
from foretwin.contracts.process import hold
from foretwin.orchestrator.commands.cli import EXIT_USER, run
from tests.orchestrator.campaign.campaigns import campaign

COVERS = (
    "foretwin.orchestrator.commands.cli_set",
    "foretwin.orchestrator.commands.set",
    "foretwin.contracts.joining",
)


def _run(
    out: Path,
    name: str,
    exit_word: str,
    endpoint: str = "tcp/127.0.0.1:7447",
    *,
    killed: bool = False,
) -> Path:
    folder = out / name
    folder.mkdir(parents=True)
    record = {"run_id": name, "exit": exit_word, "endpoint": endpoint}
    (folder / "run.json").write_text(json.dumps(record).ljust(2000))
    (folder / "log.jsonl").touch()
    if exit_word == "running" and not killed:
        hold(folder / "log.jsonl")
    return folder


def test_the_newest_drive_that_goes_on_is_meant(tmp_path: Path) -> None:
    _run(tmp_path, "20261121-100000-aaaa", "running")
    newest = _run(tmp_path, "20261121-110000-bbbb", "running")
    _run(tmp_path, "20261121-120000-cccc", "completed")
    _run(tmp_path, "20261121-130000-dddd", "running", killed=True)
    (tmp_path / "notes.txt").write_text("no run")
    found = newest_running(tmp_path)
    assert (found.run_id, found.folder) == (newest.name, newest)
    assert found.endpoint == "tcp/127.0.0.1:7447"


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (["role.ego=twin"], "no drive is running there; --run names one elsewhere"),
        (["role.ego"], "role.ego: must be KEY=VALUE, such as role.ego=shadow"),
        (["=twin"], "=twin: must be KEY=VALUE, such as role.ego=shadow"),
        (["role.ego=twin", "--run", "over"], "over: the run has ended (completed)"),
        (["role.ego=twin", "--run", "none"], "none: no such folder, and"),
    ],
)
def test_what_cannot_be_asked_ends_in_one_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], arguments: list[str], told: str
) -> None:
    _run(tmp_path, "over", "completed")
    assert run(["set", *arguments, "--out", str(tmp_path)]) == EXIT_USER
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith("foretwin: ")
    assert told in line


def test_a_drive_that_was_killed_is_told_apart(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = _run(tmp_path, "killed", "running", killed=True)
    assert run(["set", "role.ego=twin", "--run", str(folder)]) == EXIT_USER
    (line,) = capsys.readouterr().err.splitlines()
    assert f"the drive was killed; `foretwin recover {folder}` makes" in line


def test_a_drive_whose_router_does_not_answer_is_named(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("foretwin.contracts.zenoh_config.CONNECT_S", 0.3)
    folder = _run(tmp_path, "deaf", "running", endpoint := free_endpoint())
    assert run(["set", "role.ego=twin", "--run", str(folder)]) == EXIT_USER
    (line,) = capsys.readouterr().err.splitlines()
    assert f"nobody listens at {endpoint}" in line


def test_a_record_without_an_endpoint_is_named(tmp_path: Path) -> None:
    folder = tmp_path / "old"
    folder.mkdir()
    (folder / "run.json").write_text('{"run_id": "old", "exit": "running"}')
    with pytest.raises(ValueError, match=r"old/run\.json: does not say where the drive listens"):
        running_drive(folder)


def test_a_drive_over_a_network_wants_its_operator(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("foretwin.contracts.zenoh_config.CONNECT_S", 0.3)
    where = f"tls/localhost:{free_port()}"
    _run(tmp_path / "runs", "20261121-100000-aaaa", "running", where)
    asked = ["set", "role.ego=twin", "--out", str(tmp_path / "runs")]
    assert run(asked) == EXIT_USER
    assert "--secure FOLDER, with the operator's certificate" in capsys.readouterr().err
    folder = campaign(tmp_path / "c")
    assert run([*asked, "--secure", str(folder)]) == EXIT_USER
    assert "nobody listens at localhost" in capsys.readouterr().err
