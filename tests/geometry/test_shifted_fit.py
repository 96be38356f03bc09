"""Shifts and sizes found in signals made to have them, with deviations that hold."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from foretwin.contracts.arrays import Array
from foretwin.geometry.shifted_fit import (
    LONGEST_SHIFT_S,
    ShiftedFit,
    shifted,
    shifted_fit,
)

PERIOD_S = 0.02
TIME_S = np.arange(3500) * PERIOD_S
ONE = np.ones(len(TIME_S))
FREE = np.array([np.inf, np.inf])


def turning(time_s: Array) -> Array:
    return np.asarray(0.2 * np.sin(0.9 * time_s) + 0.1 * np.sin(2.3 * time_s + 1.0))


def fitted(
    y: Array,
    *,
    column: Array | None = None,
    prior_std: Array = FREE,
    shift_prior_s: float = float("inf"),
) -> ShiftedFit | None:
    followed = turning(TIME_S) if column is None else column
    columns = np.stack([followed, ONE[: len(followed)]], axis=1)
    return shifted_fit(
        y,
        columns,
        period_s=PERIOD_S,
        around=np.array([1.0, 0.0]),
        prior_std=prior_std,
        shift_prior_s=shift_prior_s,
    )


@settings(max_examples=20, deadline=None)
@given(
    shift_s=st.floats(-0.8, 0.8),
    gain=st.sampled_from([-1.0, 0.6, 1.0]),
    bias=st.floats(-0.1, 0.1),
)
def test_shift_gain_and_bias_are_found(shift_s: float, gain: float, bias: float) -> None:
    fit = fitted(gain * turning(TIME_S - shift_s) + bias)
    assert fit is not None
    assert fit.shift_s == pytest.approx(shift_s, abs=1e-3)
    assert fit.sizes == pytest.approx([gain, bias], abs=2e-3)


def test_of_many_noisy_drives_the_deviation_of_the_shift_holds_the_truth() -> None:
    random, off = np.random.default_rng(1), []
    for _ in range(40):
        noise = np.convolve(random.normal(0.0, 0.1, len(TIME_S)), np.ones(25) / 25.0, mode="same")
        fit = fitted(turning(TIME_S - 0.13) + noise)
        assert fit is not None
        off.append(abs(fit.shift_s - 0.13) / fit.shift_std_s)
        assert fit.shift_std_s < 0.02
    assert 34 <= np.sum(np.array(off) < 1.96) <= 40


def test_what_is_known_before_holds_where_a_signal_says_nothing() -> None:
    noise = np.random.default_rng(2).normal(0.0, 1.0, len(TIME_S))
    fit = fitted(noise, prior_std=np.array([0.01, np.inf]), shift_prior_s=1e-4)
    assert fit is not None
    assert fit.sizes[0] == pytest.approx(1.0, abs=0.02)
    assert fit.shift_s == pytest.approx(0.0, abs=1e-3)


@pytest.mark.parametrize(
    ("turns", "half_width", "quantile"),
    [(0.01, 0.195, 1.96), (0.05, 0.18, 1.96), (0.2, 0.10, 2.2), (1.0, 0.028, 2.55)],
)
def test_intervals_hold_whether_the_drive_tells_the_gain_or_the_prior_holds_it(
    turns: float, half_width: float, quantile: float
) -> None:
    """From a straight road to a winding one, 36 s of each: then six stretches tell the gain."""
    random, held, half_widths, quantiles = np.random.default_rng(3), [], [], []
    count, known = 1800, np.array([0.1, np.inf])
    column = turns * turning(TIME_S[:count])
    for _ in range(100):
        gain = 1.0 + 0.1 * random.normal()
        alike = 0.02 * np.repeat(random.normal(size=count // 15), 15)
        fit = fitted(gain * column + alike, column=column, prior_std=known, shift_prior_s=0.05)
        assert fit is not None
        held.append(abs(fit.sizes[0] - gain) < fit.half_widths[0])
        half_widths.append(fit.half_widths[0])
        quantiles.append(fit.quantile[0])
    assert 90 <= np.sum(held) <= 99
    assert np.median(half_widths) == pytest.approx(half_width, rel=0.15)
    assert np.median(quantiles) == pytest.approx(quantile, abs=0.1)


def test_less_than_half_a_minute_says_nothing() -> None:
    y = turning(TIME_S)
    y[1400:] = np.nan
    assert fitted(y) is None


def test_a_shifted_signal_is_between_its_samples_and_unknown_beyond_them() -> None:
    late = shifted(TIME_S, 0.03, period_s=PERIOD_S)
    assert late[10:-10] == pytest.approx(TIME_S[10:-10] - 0.03)
    assert np.isnan(late[0])
    assert np.isnan(shifted(TIME_S, -LONGEST_SHIFT_S, period_s=PERIOD_S)[-1])


def test_each_stretch_is_left_out_once() -> None:
    fit = fitted(turning(TIME_S))
    assert fit is not None
    assert len(fit.without) == fit.block.max() + 1
    counts = np.bincount(fit.block[fit.block >= 0])
    assert (counts[:-1] == 300).all()
