"""What a car was told between two commands: a record may hold few of those that were sent."""

from __future__ import annotations

from collections import Counter

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from foretwin.sim_worker.analysis.gap.between_commands import SELDOM_S, between_commands
from foretwin.sim_worker.analysis.gap.verdict import FaultDetector
from foretwin.sim_worker.analysis.motion_record import PERIOD_S
from tests.sim_worker.analysis.gap.judging_faults import NAMES, verdicts_on
from tests.sim_worker.faulty_standin import drive_of, model_with
from tests.telemetry.standin_drive import FRAME

COUNT = 200


def held(every: int, *, lost: slice = slice(0)) -> tuple[np.ndarray, np.ndarray]:
    """Return commands that rise by one in each tick, of which one in `every` is known, and how
    long each has held."""
    age = (np.arange(COUNT) % every).astype(float)
    told = np.arange(COUNT) - age
    age[lost] = told[lost] = np.nan
    return told, age * PERIOD_S


def test_commands_at_the_usual_rate_hold() -> None:
    for every in (1, 2, 3):
        told, age_s = held(every)
        between = between_commands(age_s)
        assert not between.rare.any()
        np.testing.assert_array_equal(between.of(told), told)


@given(every=st.integers(4, 12))
def test_between_seldom_ones_they_go_on_to_the_next(every: int) -> None:
    told, age_s = held(every)
    between = between_commands(age_s)
    last = COUNT - 1 - (COUNT - 1) % every  # behind it nothing is known
    assert between.rare[:last].all()
    np.testing.assert_allclose(between.of(told)[:last], np.arange(last))
    np.testing.assert_array_equal(between.of(told)[last:], told[last:])


def test_those_that_come_twice_a_second_are_known_for_a_quarter_of_one() -> None:
    told, age_s = held(25)
    found = between_commands(age_s).of(told)
    known = age_s <= SELDOM_S
    assert np.isnan(found[~known]).all()
    np.testing.assert_array_equal(found[known], told[known])


def test_nothing_leads_across_a_hole() -> None:
    told, age_s = held(5, lost=slice(52, 80))
    found = between_commands(age_s).of(told)
    assert np.isnan(found[52:80]).all()
    np.testing.assert_allclose(found[:50], np.arange(50))
    np.testing.assert_array_equal(found[50:52], [50.0, 50.0])
    assert found[81] == pytest.approx(81.0)


def thinned(fault: str | None, every: int, *channels: str, seed: int) -> list[str]:
    """Return the causes told of a drive of whose samples on some channels one in `every` is."""
    drive, kept, seen = drive_of(seed, fault), [], Counter[str]()
    for channel, message in drive.samples:
        if channel not in channels or seen[channel] % every == 0:
            kept.append((channel, message))
        seen[channel] += 1
    detector = FaultDetector(drive.info, model_with(None), frame=FRAME)
    return [one.cause for one in verdicts_on(detector, drive._replace(samples=kept))]


def test_a_log_that_holds_a_part_of_the_commands_accuses_nobody() -> None:
    """At 10, 5 and 2 Hz they come in steps that no car followed; what it was told is between."""
    assert thinned(None, 5, "control", "steering", "speed", "imu", seed=3) == []
    assert thinned(None, 10, "control", seed=1) == []
    assert thinned(None, 25, "control", seed=5) == []


@pytest.mark.parametrize("fault", ["steering_gain", "slow_steering", "saturated_steering"])
def test_and_names_a_fault_as_if_it_held_all(fault: str) -> None:
    assert thinned(fault, 5, "control", "steering", "speed", seed=2)[0] in NAMES[fault]
