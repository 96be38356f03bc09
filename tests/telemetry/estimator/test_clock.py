"""The vehicle's clock against the receiver's: the least delayed samples tell."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from foretwin.telemetry.estimator.clock import ClockEstimator

START_NS = 1_700_000_000_000_000_000
MONO_NS = 5_000_000_000


def heard(
    delay_s: Callable[[float], float],
    *,
    until_s: float,
    rate_hz: float = 50.0,
    fast_ppm: float = 0.0,
) -> ClockEstimator:
    """Return a clock told of samples sent at a steady rate, each delayed by `delay_s(time)`."""
    clock = ClockEstimator()
    arrivals = []
    for k in range(round(until_s * rate_hz)):
        time_s = k / rate_hz
        stamp_ns = START_NS + round(time_s * (1.0 + fast_ppm * 1e-6) * 1e9)
        arrivals.append((MONO_NS + round((time_s + delay_s(time_s)) * 1e9), stamp_ns))
    for received_ns, stamp_ns in sorted(arrivals):
        clock.handle(stamp_ns, received_ns)
    return clock


def jitter(seed: int, least_s: float, most_s: float) -> Callable[[float], float]:
    random = np.random.default_rng(seed)
    return lambda _: float(random.uniform(least_s, most_s))


def test_before_the_first_sample_nothing_is_known() -> None:
    clock = ClockEstimator()
    assert not clock.known
    assert (clock.offset_ns, clock.drift_ppm, clock.spread_s()) == (0, 0.0, 0.0)


def test_a_constant_delay_is_part_of_the_offset() -> None:
    clock = heard(lambda _: 0.02, until_s=2.0)
    assert clock.offset_ns == MONO_NS - START_NS + 20_000_000
    assert clock.drift_ppm == 0.0
    assert clock.stamp_at(MONO_NS + 1_020_000_000) == START_NS + 1_000_000_000


@pytest.mark.parametrize("fast_ppm", [-80.0, 0.0, 50.0])
def test_drift_shows_through_jitter(fast_ppm: float) -> None:
    clock = heard(jitter(1, 0.01, 0.06), until_s=60.0, fast_ppm=fast_ppm)
    assert clock.drift_ppm == pytest.approx(fast_ppm, abs=12.0)
    exact_ns = MONO_NS - START_NS - round(fast_ppm * 1e-6 * 60.0 * 1e9) + 10_000_000
    assert abs(clock.offset_ns - exact_ns) < 1_000_000
    assert clock.spread_s() == pytest.approx(0.0475, abs=0.004)


def test_stretches_of_long_delays_do_not_move_the_clock() -> None:
    """Five seconds of every ten all samples wait for at least 80 ms more."""
    noise = jitter(2, 0.01, 0.06)
    clock = heard(lambda t: noise(t) + (0.08 if t % 10.0 > 5.0 else 0.0), until_s=38.0)
    assert abs(clock.offset_ns - (MONO_NS - START_NS + 10_000_000)) < 2_000_000


def test_a_longer_way_is_believed_once_the_window_has_passed() -> None:
    noise = jitter(3, 0.01, 0.03)
    clock = heard(lambda t: noise(t) + (0.1 if t > 20.0 else 0.0), until_s=55.0)
    assert abs(clock.offset_ns - (MONO_NS - START_NS + 110_000_000)) < 2_000_000


@settings(max_examples=25, deadline=None)
@given(
    seed=st.integers(0, 1000),
    fast_ppm=st.floats(-100.0, 100.0),
    least_s=st.floats(0.0, 0.5),
    spread_s=st.floats(0.0, 0.1),
)
def test_no_sample_ever_lies_below_the_clock_and_the_error_is_small(
    seed: int, fast_ppm: float, least_s: float, spread_s: float
) -> None:
    """The bound: what the drift does within the third of the window in which it is not known."""
    clock = heard(
        jitter(seed, least_s, least_s + spread_s), until_s=20.0, rate_hz=20.0, fast_ppm=fast_ppm
    )
    exact_ns = MONO_NS - START_NS + round((least_s - fast_ppm * 1e-6 * 20.0) * 1e9)
    assert abs(clock.offset_ns - exact_ns) < 1_500_000 + 0.1 * spread_s * 1e9
    assert clock.spread_s(0.0) >= -1e-9
