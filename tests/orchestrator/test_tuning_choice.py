"""Whether the vehicle is watched: what was asked for, else where workers have a processor each."""

from __future__ import annotations

import pytest

from foretwin.orchestrator.config import DriveConfig
from foretwin.orchestrator.processors import processors
from foretwin.orchestrator.tuning_choice import Tuning, choose_tuning


@pytest.mark.parametrize(
    ("workers", "count", "mode"),
    [(2, 1, "off"), (3, 2, "off"), (2, 2, "report"), (2, 16, "report"), (1, 1, "report")],
)
def test_by_default_it_is_watched_where_workers_have_a_processor_each(
    workers: int, count: int, mode: str
) -> None:
    choice = choose_tuning(None, lock_step=False, workers=workers, processors=count)
    assert choice.mode == mode
    assert choice.text.startswith(f"tuning {mode}: {count} processor")
    assert f"for {workers} worker" in choice.text


@pytest.mark.parametrize("lock_step", [False, True])
@pytest.mark.parametrize("asked", ["off", "report", "apply"])
def test_what_was_asked_for_counts_on_every_machine(asked: Tuning, lock_step: bool) -> None:
    for count in (1, 64):
        choice = choose_tuning(asked, lock_step=lock_step, workers=2, processors=count)
        assert choice.text == f"tuning {asked}: as was asked for"


def test_in_lock_step_the_machine_decides_nothing() -> None:
    choices = {
        choose_tuning(None, lock_step=True, workers=workers, processors=count)
        for workers in (1, 8)
        for count in (1, 64)
    }
    assert [choice.mode for choice in choices] == ["report"]


def test_a_drive_asks_for_this_machine() -> None:
    assert processors() >= 1
    assert DriveConfig(speed=None).tuning_choice.mode == "report"
    assert DriveConfig(workers=processors()).tuning_choice.mode == "report"
    many = processors() + 1
    assert DriveConfig(workers=many).tuning_choice.mode == "off"
    assert DriveConfig(workers=many, tuning="apply").tuning_choice.mode == "apply"
