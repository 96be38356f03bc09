"""Over two hundred seeded glitches in clean drives: the car neither stops nor turns by them."""

from __future__ import annotations

import functools
from collections import Counter
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest

from foretwin.telemetry.logs import Log
from tests.telemetry.city_drive import FRAME, city_drive, xy_of
from tests.trust.consistency import Consistency, consistency_of
from tests.trust.drives import given_drives
from tests.trust.glitches import KINDS, SPACING_S, Glitch, glitched, glitches
from tests.trust.states import states_of
from tests.trust.truth import Truth, smoothed, truth_of

ALONE_KINDS = tuple(kind for kind in KINDS if kind != "sigma_small")


class Glitched(NamedTuple):
    """What is found of a drive with its glitches, and these."""

    found: Consistency
    planted: list[Glitch]
    skipped: Counter[str]

    def during(self, at_s: float) -> Glitch:
        """Return the glitch that was there last."""
        return max((g for g in self.planted if g.begin_s <= at_s + 0.3), key=lambda g: g.begin_s)


def with_glitches(log: Log, truth: Truth, planted: list[Glitch]) -> Glitched:
    """Let a car hear a log until the last of its glitches is over."""
    heard = list(log.samples())
    end_ns = heard[0][1].stamp_ns + round(1e9 * (planted[-1].begin_s + SPACING_S))
    samples = glitched([one for one in heard if one[1].stamp_ns < end_ns], planted, seed=6)
    states = states_of(Log(info=log.info, read=lambda _skipped: iter(samples)), truth.frame)
    return Glitched(consistency_of(states, truth), planted, states.skipped)


@functools.cache
def standin() -> tuple[Log, Truth]:
    drive = city_drive()
    samples = drive.samples
    stamps = np.array([m.stamp_ns for channel, m in samples if channel == "gnss"])
    xy = np.array([xy_of(drive.source.truth(int(stamp))) for stamp in stamps])
    truth = smoothed(FRAME, stamps, xy, position_std_m=0.001)
    return Log(info=drive.source.info, read=lambda _skipped: iter(samples)), truth


@pytest.mark.parametrize("seed", range(4))
def test_a_car_with_wheels_and_gyro_is_not_misled(seed: int) -> None:
    """The stand-in: eight glitches of all kinds in each of four drives."""
    log, truth = standin()
    drive = with_glitches(log, truth, glitches(8, from_s=6.0, seed=seed))
    assert drive.found.false_standstills_s == ()
    assert drive.found.yaw_losses_s == ()
    assert drive.found.speed_rms_mps < 0.2


@pytest.mark.real_data
@pytest.mark.parametrize(("name", "count"), [
    ("boreas", 30), pytest.param("boreas", 100, marks=pytest.mark.judge),
    ("potsdamer-platz-odometry", 28),
])  # fmt: skip
def test_a_real_car_with_wheels_and_a_heading_is_not_misled(
    data_dir: Path, name: str, count: int
) -> None:
    drive = next(d for d in given_drives(data_dir) if d.name == name)
    planted = glitches(count, from_s=20.0, seed=5)
    run = with_glitches(drive.log(), truth_of(drive), planted)
    assert run.found.false_standstills_s == ()
    assert len(run.found.yaw_losses_s) <= 1
    assert run.found.speed_rms_mps < 0.3


@pytest.mark.real_data
@pytest.mark.parametrize("count", [50, pytest.param(100, marks=pytest.mark.judge)])
def test_positions_alone_survive_all_but_noise_that_nothing_tells_of(
    data_dir: Path, count: int
) -> None:
    """Two metres of noise from one fix to the next that are stated as centimetres hide the motion.

    So those may mislead while they last; what all others do to a car is next to nothing.
    """
    drive = next(d for d in given_drives(data_dir) if d.name == "boreas-positions")
    run = with_glitches(drive.log(), truth_of(drive), glitches(count, from_s=20.0, seed=5))
    misled = Counter(
        run.during(at_s).kind for at_s in (*run.found.false_standstills_s, *run.found.yaw_losses_s)
    )
    assert sum(misled[kind] for kind in ALONE_KINDS) <= 0.04 * count
    for at_s in run.found.yaw_losses_s:
        glitch = run.during(at_s)
        assert at_s < min(glitch.end_s, glitch.begin_s + SPACING_S) + 3.0


def test_glitches_are_the_same_for_a_seed_and_change_what_they_say() -> None:
    log, _ = standin()
    planted = glitches(8, from_s=6.0, seed=1)
    assert planted == glitches(8, from_s=6.0, seed=1)
    clean = list(log.samples())
    once, again = (glitched(clean, planted, seed=2) for _ in range(2))
    assert once == again
    assert once != clean
    assert glitched(clean, [], seed=2) == clean
