"""Stamps of another clock than the positions': left out, so that no position looks late."""

from __future__ import annotations

from collections import Counter
from pathlib import Path

import pytest

from foretwin.telemetry.logs import open_log
from foretwin.telemetry.logs.fix_clock import OTHER_CLOCK, FixClock
from foretwin.telemetry.ros_messages.parts import NAV_SAT_FIX, VELOCITY_REPORT
from tests.telemetry.test_foreign_mcap import LAG_NS, START_NS, ForeignFile, fix, velocity

S = 10**9
AHEAD_NS = 2 * S


def counted(tmp_path: Path, ahead_s: list[int]) -> tuple[Counter[str], Counter[str]]:
    """Positions at 10 Hz, and speeds so far ahead of them; returns what came, and what did not."""
    file = ForeignFile(tmp_path / "bag.mcap")
    for number, ahead in enumerate(ahead_s):
        at_ns = START_NS + number * S // 10
        speed = velocity(at_ns + ahead * S, 5.0)
        file.add("/vel", VELOCITY_REPORT, speed, at_ns + LAG_NS)
        file.add("/fix", NAV_SAT_FIX, fix(at_ns, 52.5 + 1e-5 * number), at_ns + LAG_NS)
    log = open_log(file.close())
    return Counter(channel for channel, _ in log.samples()), log.skipped


@pytest.mark.parametrize("leap_s", [5, 18, 37])
def test_a_sensor_on_another_clock_does_not_cost_the_positions(tmp_path: Path, leap_s: int) -> None:
    came, refused = counted(tmp_path, [leap_s] * 60)
    assert came == {"gnss": 60}
    assert refused == {OTHER_CLOCK: 60}


def test_one_damaged_stamp_costs_one_sample(tmp_path: Path) -> None:
    came, refused = counted(tmp_path, [3600 * (number == 20) for number in range(60)])
    assert came == {"gnss": 60, "speed": 59}
    assert refused == {OTHER_CLOCK: 1}


def test_what_comes_late_or_a_little_ahead_is_taken() -> None:
    clock = FixClock(0, most_ahead_ns=AHEAD_NS)
    assert clock.takes(12 * S, 10 * S, is_fix=False)
    assert not clock.takes(12 * S + 1, 10 * S, is_fix=False)
    assert clock.takes(0, 10 * S, is_fix=False)


def test_positions_are_believed_where_a_second_one_bears_the_first_out() -> None:
    clock = FixClock(0, most_ahead_ns=AHEAD_NS)
    assert not clock.takes(70 * S, 10 * S, is_fix=True)  # damaged
    assert not clock.takes(90 * S, 10 * S, is_fix=True)  # and otherwise
    assert clock.takes(11 * S, 11 * S, is_fix=True)
    assert not clock.takes(72 * S, 12 * S, is_fix=True)
    assert clock.takes(73 * S, 13 * S, is_fix=True)  # the clock has stepped
    assert clock.takes(73 * S, 13 * S, is_fix=False)


def test_a_clock_that_drifts_is_followed() -> None:
    clock = FixClock(0, most_ahead_ns=AHEAD_NS)
    for second in range(100):
        ahead_ns = second * S // 10
        assert clock.takes(second * S + ahead_ns, second * S, is_fix=True)
        assert clock.takes(second * S + ahead_ns, second * S, is_fix=False)
