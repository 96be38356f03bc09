"""Gains, delays and plateaus found in signals made to have them."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from foretwin.sim_worker.analysis.gap.fitting import delayed_line, line_through
from foretwin.sim_worker.analysis.motion_record import PERIOD_S

TIME_S = np.arange(400) * PERIOD_S
ASKED = 0.2 * np.sin(1.7 * TIME_S) + 0.1 * np.sin(0.6 * TIME_S + 1.0)


@settings(max_examples=20)
@given(
    gain=st.sampled_from([-57.3, -1.0, 0.3, 1.0, 57.3]),
    shift=st.integers(0, 35),
    offset=st.floats(-0.3, 0.3),
)
def test_gain_offset_and_delay_are_found(gain: float, shift: int, offset: float) -> None:
    done = np.full(len(ASKED), np.nan)
    done[shift:] = gain * ASKED[: len(ASKED) - shift] + offset
    pair = delayed_line(ASKED, done)
    assert pair is not None
    assert pair.line.gain == pytest.approx(gain, rel=1e-6)
    assert pair.line.offset == pytest.approx(offset, abs=1e-6)
    assert pair.delay_s == pytest.approx(shift * PERIOD_S)
    assert np.isnan(pair.saturated_at)


def test_a_plateau_below_what_is_asked_is_saturation_and_a_small_gain_is_none() -> None:
    clipped = delayed_line(ASKED, np.clip(ASKED, -0.12, 0.12))
    assert clipped is not None
    assert clipped.saturated_at == pytest.approx(0.12, rel=0.02)
    weak = delayed_line(ASKED, 0.5 * ASKED)
    assert weak is not None
    assert np.isnan(weak.saturated_at)


def test_deviations_hold_what_noise_does_to_a_line() -> None:
    random = np.random.default_rng(0)
    x = random.normal(0.0, 1.0, 200)
    off = []
    for _ in range(200):
        line = line_through(x, 2.0 * x + random.normal(0.0, 0.5, 200), independent=200.0)
        assert line is not None
        off.append((line.gain - 2.0) / line.gain_std)
    assert 0.85 < float(np.std(off)) < 1.15


def test_what_does_not_vary_has_no_line() -> None:
    assert line_through(np.ones(50), np.ones(50), independent=20.0) is None
    assert line_through(np.arange(50.0), np.arange(50.0), independent=2.0) is None
    assert delayed_line(np.full(300, np.nan), np.full(300, np.nan)) is None
