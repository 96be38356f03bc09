"""Another machine's clock is known to half the time that a question takes."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from foretwin.telemetry.estimator.far_clock import FarClock

NOW_NS = 1_800_000_000_000_000_000


def asked(clock: FarClock, *, off_s: float, there_s: float, back_s: float) -> None:
    theirs_ns = NOW_NS - round(1e9 * back_s) + round(1e9 * off_s)
    clock.take(10.0, 10.0 + there_s + back_s, ours_ns=NOW_NS, theirs_ns=theirs_ns)


@given(off_s=st.floats(-5.0, 5.0), there_s=st.floats(0.0, 1.0), back_s=st.floats(0.0, 1.0))
def test_the_true_offset_is_within_half_the_link(
    off_s: float, there_s: float, back_s: float
) -> None:
    clock = FarClock()
    asked(clock, off_s=off_s, there_s=there_s, back_s=back_s)
    assert abs(clock.best.offset_s - off_s) <= clock.best.link_s / 2 + 1e-6
    assert not clock.beyond(abs(off_s) + 1e-6)


def test_the_quickest_answer_counts_and_the_newest_tells_of_the_link() -> None:
    clock = FarClock()
    asked(clock, off_s=0.02, there_s=0.001, back_s=0.001)
    asked(clock, off_s=0.02, there_s=0.4, back_s=0.0)
    assert clock.best.offset_s == pytest.approx(0.02, abs=1e-6)
    assert clock.last.link_s == pytest.approx(0.4)
    assert clock.beyond(0.01)


def test_what_a_slow_link_cannot_tell_is_held_against_nobody() -> None:
    clock = FarClock()
    asked(clock, off_s=0.0, there_s=2.0, back_s=0.0)
    assert clock.best.offset_s == pytest.approx(1.0)
    assert not clock.beyond(0.5)
