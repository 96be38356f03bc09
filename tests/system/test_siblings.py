"""A second engine beside the rounds of a whole drive changes nothing of it, dead or alive."""

from __future__ import annotations

import os
import signal
from pathlib import Path

import pytest

from tests.system.foretwin_command import foretwin
from tests.system.test_faults import (
    ENDS_WITHIN_S,
    assert_nothing_left,
    assert_readable,
    child_pids,
    command,
    says,
    started,
    under_way,
    wait_for,
)

pytestmark = [pytest.mark.judge, pytest.mark.timeout(900)]


def test_in_lock_step_the_drive_is_the_same_with_and_without(tmp_path: Path) -> None:
    small = ("--speed", "max", "--futures", "16", "--end", "5", "--tuning", "off")
    without, beside = (
        foretwin(tmp_path / engine, *small, "--siblings", engine) for engine in ("off", "multibody")
    )
    assert (without.code, beside.code) == (0, 0), without.screen + beside.screen
    before, after = without.record(), beside.record()
    assert before["futures"]["sha256"] == after["futures"]["sha256"]
    assert before["siblings"] is None
    assert after["siblings"]["rounds"] == after["futures"]["rounds"] > 5
    assert "multibody played" in beside.screen

    rows = beside.rows("siblings")
    assert {row["which"] for row in rows} == {"nominal", "worst"}
    for row in rows[-2:]:
        asked = ["repeat", str(beside.run), row["future_id"], "--physics", "multibody"]
        assert command(asked) == 0


def test_a_sibling_that_is_killed_is_started_again_and_the_drive_goes_on(tmp_path: Path) -> None:
    out = tmp_path / "runs"
    with started(out, "--siblings", "multibody", "--futures", "12") as process:
        run = under_way(out)
        victim = child_pids(run)["sibling"]
        os.kill(victim, signal.SIGKILL)
        wait_for(lambda: says(run, "sibling ended with code -9; started again"), "the death seen")
        wait_for(lambda: child_pids(run)["sibling"] != victim, "the new one")
        process.send_signal(signal.SIGINT)
        screen, _ = process.communicate(timeout=ENDS_WITHIN_S)
    assert process.returncode == 130, screen
    assert "Traceback" not in screen
    assert screen.count("sibling ended with code -9") == 1
    assert_readable(run)
    assert_nothing_left(run)
