"""How a vehicle's clock stands to the car's: asked where both answer, else from samples."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from foretwin.orchestrator.other_vehicles.vehicle_clock import (
    ONE_WAY_STD_S,
    VehicleClock,
    between,
)

ASKED_NS = 77_000_000_000_000
STAMP_NS = 1_700_000_000_000_000_000
AHEAD_NS = STAMP_NS - ASKED_NS
"""What the vehicle's clock is ahead of ours."""
delays = st.floats(0.001, 0.3)


def ask(clock: VehicleClock, *, there_s: float, back_s: float, ahead_ns: int = AHEAD_NS) -> None:
    read_ns = ASKED_NS + round(there_s * 1e9)
    clock.answered(ASKED_NS, read_ns + round(back_s * 1e9), read_ns + ahead_ns)


@given(delays, delays)
def test_a_clock_that_is_asked_is_known_to_half_of_what_that_took(
    there_s: float, back_s: float
) -> None:
    clock = VehicleClock()
    ask(clock, there_s=there_s, back_s=back_s)
    reading = clock.reading(5)
    assert reading is not None
    error_s = abs(reading.offset_ns + AHEAD_NS) * 1e-9
    assert error_s <= (there_s + back_s) / 2.0 + 1e-6
    assert reading.std_s == pytest.approx((there_s + back_s) / 12**0.5)
    assert reading.how == "asked"


def test_the_quickest_answer_counts_until_the_clock_steps() -> None:
    clock = VehicleClock()
    ask(clock, there_s=0.08, back_s=0.08)
    ask(clock, there_s=0.30, back_s=0.08)
    steady = clock.reading(None)
    assert steady is not None
    assert steady.offset_ns == pytest.approx(-AHEAD_NS, abs=1000)
    ask(clock, there_s=0.2, back_s=0.2, ahead_ns=AHEAD_NS + 1_000_000_000)
    stepped = clock.reading(None)
    assert stepped is not None
    assert stepped.offset_ns == pytest.approx(-AHEAD_NS - 1_000_000_000, abs=1000)


def test_who_does_not_answer_is_judged_by_its_quickest_sample_and_that_is_said() -> None:
    clock = VehicleClock()
    assert clock.reading(None) is None
    reading = clock.reading(-123)
    assert reading is not None
    assert (reading.offset_ns, reading.std_s, reading.how) == (-123, ONE_WAY_STD_S, "one way")


def test_between_two_clocks_the_doubts_of_both_add_up() -> None:
    own, other = VehicleClock(), VehicleClock()
    ask(own, there_s=0.01, back_s=0.01)
    ask(other, there_s=0.08, back_s=0.08, ahead_ns=AHEAD_NS + 1_000_000_000)
    mine, theirs = own.reading(None), other.reading(None)
    assert mine is not None
    assert theirs is not None
    found = between(mine, theirs)
    assert found.later_ns == pytest.approx(-1_000_000_000, abs=2000)
    assert found.std_s == pytest.approx((0.02**2 + 0.16**2) ** 0.5 / 12**0.5)
    assert found.text == "its clock is 1.000 s ahead of the car's, ± 47 ms (asked)"
    guessed = between(mine, VehicleClock().reading(0))  # type: ignore[arg-type]
    assert (guessed.how, guessed.std_s > ONE_WAY_STD_S) == ("one way", True)
