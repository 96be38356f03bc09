"""Who writes in a run's folder, and what is said of one that never came to its end."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from foretwin.contracts.errors import UserError
from foretwin.orchestrator.record.run_state import (
    RunGoesOnError,
    check_finished,
    read_record,
    run_lock,
)
from tests.orchestrator.record.ended_badly import killed_run


def test_one_at_a_time_holds_a_run(tmp_path: Path) -> None:
    with run_lock(tmp_path), pytest.raises(RunGoesOnError, match="still runs"), run_lock(tmp_path):
        pass
    with run_lock(tmp_path):
        pass


def test_a_run_that_goes_on_and_one_that_was_killed_are_told_apart(tmp_path: Path) -> None:
    run = killed_run(tmp_path / "run")
    with run_lock(run), pytest.raises(UserError, match="the drive still runs"):
        check_finished(run)
    with pytest.raises(UserError, match=f"never came to its end: `foretwin recover {run}`"):
        check_finished(run)


def test_streams_alone_make_a_run_unfinished(tmp_path: Path) -> None:
    """As where the disk was too full for Parquet at the end."""
    run = killed_run(tmp_path / "run")
    (run / "run.json").write_text(json.dumps({"run_id": "r1", "exit": "completed"}))
    with pytest.raises(UserError, match="foretwin recover"):
        check_finished(run)


def test_a_finished_run_and_what_is_none_pass(tmp_path: Path) -> None:
    (tmp_path / "run.json").write_text(json.dumps({"run_id": "r1", "exit": "interrupted"}))
    check_finished(tmp_path)
    check_finished(tmp_path / "nowhere")


@pytest.mark.parametrize("text", ["", "{", "[]", "nonsense"])
def test_a_torn_record_says_nothing(tmp_path: Path, text: str) -> None:
    (tmp_path / "run.json").write_text(text)
    assert read_record(tmp_path) == {}
