"""Comfort of a drive that is known by noisy estimates: noise fails nobody, hard braking does."""

from __future__ import annotations

import numpy as np
import pytest

from foretwin.contracts.arrays import Array
from foretwin.sim_worker.analysis.agreement.jolts import gently
from foretwin.sim_worker.analysis.agreement.judgement import VerdictWord, word
from foretwin.sim_worker.metrics.comfort import motion, motion_std
from foretwin.sim_worker.metrics.rollout import RolloutView
from tests.sim_worker.metrics.motions import Mover, rollout, times

TIME_S = times(8.0)
RATE_S = 0.2
"""Between two states, as of a receiver at 5 Hz; windows lie between them."""


def estimated(speed_mps: Array, noise: Array, std_mps: float) -> VerdictWord:
    driven = rollout(Mover(0, 0, 0, 5.0), time_s=TIME_S)
    sampled_s = np.arange(0.0, 8.0 + RATE_S, RATE_S)
    told = np.interp(sampled_s, TIME_S, speed_mps) + noise[: len(sampled_s)]
    driven.states[0, :, 3] = np.interp(TIME_S, sampled_s, told)
    std = np.column_stack([np.full(len(TIME_S), std_mps), np.full(len(TIME_S), 0.03)])
    found = gently(RolloutView(driven), std)
    return word(bool(found.passes[0]), bool(found.fails[0]))


def braking(decel_mps2: float, *, ramp_s: float = 0.4) -> Array:
    """A speed (81,) that falls from 20 m/s for 1.5 s, from the third second on."""
    accel = -decel_mps2 * np.clip((TIME_S - 3.0) / ramp_s, 0.0, 1.0) * (TIME_S < 4.5)
    return 20.0 + np.concatenate([[0.0], np.cumsum(accel[:-1] * 0.1)])


@pytest.mark.parametrize("std_mps", [0.02, 0.16, 0.5])
def test_noise_as_large_as_it_is_stated_fails_nobody(std_mps: float) -> None:
    noise = np.random.default_rng(4).normal(0.0, std_mps, (300, 60))
    gentle = 10.0 + np.sin(0.5 * TIME_S)
    words = [estimated(gentle, one, std_mps) for one in noise]
    assert words.count("failed") == 0
    if std_mps < 0.1:
        assert words.count("passed") == len(words)


def test_a_source_that_states_too_little_is_told_by_its_scatter() -> None:
    """One of 40 fixes is 0.8 m short: for two samples the speed is off by 4 m/s."""
    glitch = np.zeros(60)
    glitch[20], glitch[21] = -4.0, 4.0
    assert estimated(np.full(81, 10.0), glitch, 0.05) == "not_observable"


@pytest.mark.parametrize("decel_mps2", [6.0, 7.0, 9.0])
def test_who_brakes_too_hard_is_caught_however_rough_the_speed(decel_mps2: float) -> None:
    noise = np.random.default_rng(5).normal(0.0, 0.16, (50, 60))
    words = [estimated(braking(decel_mps2), one, 0.16) for one in noise]
    assert words.count("passed") == 0
    assert words.count("failed") >= 45


def test_what_no_tyre_holds_was_not_driven() -> None:
    assert estimated(braking(18.0), np.zeros(60), 0.02) == "not_observable"


def test_a_speed_that_is_hardly_known_passes_nothing() -> None:
    assert estimated(np.full(81, 10.0), np.zeros(60), 3.0) == "not_observable"


def test_a_simulation_is_known_exactly() -> None:
    hard = rollout(Mover(0, 0, 0, 5.0), time_s=TIME_S)
    hard.states[0, :, 3] = braking(4.6, ramp_s=0.4)
    found = gently(RolloutView(hard))
    assert (found.passes[0], found.fails[0]) == (False, True)


def test_the_uncertainty_of_derivatives_is_that_of_many_noisy_drives() -> None:
    count, speed_std, yaw_std = 400, 0.1, 0.02
    rng = np.random.default_rng(8)
    exact = rollout(Mover(0, 0, 0, 5.0), time_s=TIME_S)
    exact.states[0, :, 2], exact.states[0, :, 3] = 0.2 * TIME_S, 9.0 + 0.8 * TIME_S
    noisy = rollout(Mover(0, 0, 0, 5.0), time_s=TIME_S, futures=count)
    noisy.states[:] = exact.states[0]
    noisy.states[..., 2] += rng.normal(0.0, yaw_std, (count, len(TIME_S)))
    noisy.states[..., 3] += rng.normal(0.0, speed_std, (count, len(TIME_S)))
    stds = np.full(len(TIME_S), speed_std), np.full(len(TIME_S), yaw_std)
    told = motion_std(RolloutView(exact), *stds, alike_s=0.1)
    for name, values in motion(RolloutView(noisy))._asdict().items():
        if name == "jerk_mps3":  # of the size of both accelerations: no more than told
            assert (values.std(axis=0) < 1.2 * getattr(told, name)[0]).all()
        else:
            assert values.std(axis=0) == pytest.approx(getattr(told, name)[0], rel=0.2), name
