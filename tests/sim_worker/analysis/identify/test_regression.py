"""Intervals hold the truth as often as they say, whether residuals are white or last for a bend."""

from __future__ import annotations

import numpy as np
import pytest

from foretwin.contracts.arrays import Array
from foretwin.sim_worker.analysis.identify.regression import Fit, fit_linear

TRUTH = np.array([0.06, -0.3])
PERIOD_S = 0.05
TIME_S = np.arange(0.0, 60.0, PERIOD_S)


def line(seed: int, *, lasting: float, brief: bool = False) -> Fit:
    """Fit a line through 60 s of 3 s bends: white noise, and `lasting` as much for each bend."""
    random = np.random.default_rng(seed)
    per_bend = np.repeat(random.normal(size=(20, 2)), 60, axis=0)
    columns = np.column_stack([per_bend[:, 0], np.ones(len(TIME_S))])
    noise = random.normal(size=len(TIME_S)) + lasting * per_bend[:, 1]
    return fit_linear(columns, columns @ TRUTH + 0.01 * noise, TIME_S, brief=brief)


def share_held(*, lasting: float, brief: bool = False) -> Array:
    held = [
        np.abs(fit.values - TRUTH) <= [fit.half_width(0), fit.half_width(1)]
        for fit in (line(seed, lasting=lasting, brief=brief) for seed in range(200))
    ]
    return np.asarray(np.mean(held, axis=0))


@pytest.mark.parametrize(("lasting", "brief"), [(0.0, True), (0.0, False), (1.0, False)])
def test_intervals_hold_the_truth_19_times_of_20(lasting: float, brief: bool) -> None:
    share = share_held(lasting=lasting, brief=brief)
    assert share.min() > 0.90
    assert share.max() < 0.995


def test_who_takes_what_lasts_for_white_is_too_sure() -> None:
    sure = line(0, lasting=1.0, brief=True).half_width(0)
    assert sure < line(0, lasting=1.0).half_width(0)


def test_a_parameter_that_one_stretch_alone_tells_has_nothing_to_vouch_for_it() -> None:
    seldom = np.where(TIME_S < 6.0, 1.0, 0.0)
    columns = np.column_stack([seldom, np.ones(len(TIME_S))])
    noise = 0.01 * np.random.default_rng(0).normal(size=len(TIME_S))
    fit = fit_linear(
        columns, columns @ TRUTH + noise, TIME_S, prior=np.zeros(2), prior_std=np.full(2, 0.5)
    )
    assert fit.half_width(0) > 0.05
    assert fit.half_width(1) < 0.005


def test_what_nothing_tells_is_as_uncertain_as_its_prior() -> None:
    columns = np.column_stack([np.zeros(len(TIME_S)), np.ones(len(TIME_S))])
    fit = fit_linear(
        columns, columns @ TRUTH, TIME_S, prior=np.array([7.0, 0.0]), prior_std=np.array([2.0, 1.0])
    )
    assert fit.values[0] == pytest.approx(7.0)
    assert np.sqrt(fit.covariance[0, 0]) == pytest.approx(2.0)


def test_too_little_is_said() -> None:
    short = TIME_S < 10.0
    with pytest.raises(ValueError, match="less than 18 s of driving"):
        fit_linear(np.ones((int(short.sum()), 1)), np.ones(int(short.sum())), TIME_S[short])
    with pytest.raises(ValueError, match="no part in the driving"):
        fit_linear(np.zeros((len(TIME_S), 1)), TIME_S, TIME_S)
