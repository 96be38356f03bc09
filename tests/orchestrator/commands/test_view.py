"""`foretwin view`: which recording it opens, in which layout, and what it says where it cannot."""

from __future__ import annotations

import subprocess
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from foretwin.orchestrator.commands.cli import EXIT_USER, run

COVERS = ("foretwin.orchestrator.commands.cli_view",)


@pytest.fixture
def started(monkeypatch: pytest.MonkeyPatch) -> list[list[str]]:
    """What is started instead of a viewer."""
    found: list[list[str]] = []

    def start(command: list[str], **_: Any) -> SimpleNamespace:
        found.append(command)
        return SimpleNamespace(returncode=2)

    monkeypatch.setattr(subprocess, "run", start)
    return found


@pytest.fixture
def recorded(tmp_path: Path) -> Path:
    folder = tmp_path / "20261121-100000-aaaa"
    folder.mkdir()
    (folder / "run.json").write_text('{"exit": "completed"}')
    (folder / "monitor.rrd").touch()
    return folder


def test_the_latest_run_is_shown_in_its_own_layout_in_a_window(
    recorded: Path, started: list[list[str]]
) -> None:
    assert run(["view", "--out", str(recorded.parent)]) == 2
    (command,) = started
    assert command[-4:] == ["--open", str(recorded / "monitor.rrd"), "--view", "native"]
    assert "--layout" not in command


def test_a_recording_is_shown_in_the_layout_and_place_that_are_asked_for(
    recorded: Path, started: list[list[str]]
) -> None:
    for name in (recorded, recorded / "monitor.rrd"):
        run(["view", str(name), "--layout", "gap", "--view", "web"])
    for command in started:
        assert command[-6:] == [
            "--open",
            str(recorded / "monitor.rrd"),
            "--view",
            "web",
            "--layout",
            "gap",
        ]
    assert len(started) == 2


def test_what_cannot_be_shown_is_told_in_one_line(
    recorded: Path, started: list[list[str]], capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(["view", str(recorded), "--layout", "gab"]) == EXIT_USER
    (recorded / "monitor.rrd").unlink()
    assert run(["view", str(recorded)]) == EXIT_USER
    layout, missing = capsys.readouterr().err.splitlines()
    assert "--layout gab: no such file; did you mean gap" in layout
    assert missing == f"foretwin: {recorded}: holds no monitor.rrd"
    assert started == []
