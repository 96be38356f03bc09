"""What is remembered of a car's motion."""

from __future__ import annotations

import copy

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from foretwin.orchestrator.forecast.motion_history import KEPT_S, MotionHistory

S = 1_000_000_000


def driven(*speeds: tuple[float, float]) -> MotionHistory:
    history = MotionHistory()
    for time_s, speed in speeds:
        history.take(round(time_s * S), speed)
    return history


def test_a_car_that_speeds_up_steadily_goes_half_its_speed_times_the_time() -> None:
    history = driven(*((k / 10, k / 10) for k in range(41)))

    assert history.now is not None
    assert history.now.travelled_m == pytest.approx(8.0)
    assert history.travelled_at(round(3.95 * S)) == pytest.approx(7.805, abs=0.01)
    assert history.speeds_mps(np.array([0.5, 4.0, 4.5])) == pytest.approx(
        [3.5, 0.0, np.nan], nan_ok=True
    )
    assert history.since_standing_s == pytest.approx(3.6)


def test_how_far_it_had_gone_at_an_instant_of_seconds_ago_is_not_guessed_from_now() -> None:
    """20 states a second of a car that brakes from 12 m/s at 4 m/s² and stands after 3 s."""
    history = driven(*((k / 20, max(12.0 - k / 5, 0.0)) for k in range(101)))

    for ago_s, gone_m in ((0.02, 18.0), (2.0, 18.0), (4.0, 10.0), (4.02, 9.84), (4.98, 0.24)):
        assert history.travelled_at(round((5.0 - ago_s) * S)) == pytest.approx(gone_m, abs=0.01)


def test_between_uneven_states_the_nearest_on_either_side_count() -> None:
    """A state that comes soon after another is kept only while it is one of the last two."""
    history = driven((0, 10.0), (0.04, 10.0), (1.04, 0.0))

    assert history.travelled_at(round(0.02 * S)) == pytest.approx(0.2)
    assert history.travelled_at(round(0.54 * S)) == pytest.approx(0.4 + 2.5)


def test_what_was_before_all_that_is_remembered_is_not_known() -> None:
    history = driven(*((k / 10, 10.0) for k in range(5, 400)))
    oldest_s = 39.9 - KEPT_S

    assert history.travelled_at(round(oldest_s * S)) == pytest.approx(10.0 * (oldest_s - 0.5))
    assert history.travelled_at(round((oldest_s - 0.01) * S)) is None
    assert driven((1, 10.0)).travelled_at(S // 2) is None


def test_backwards_is_travelled_too() -> None:
    history = driven((0, -2.0), (1, -2.0))

    assert history.now is not None
    assert history.now.travelled_m == pytest.approx(2.0)


@pytest.mark.parametrize("next_s", [-5.0, 12.1])
def test_after_a_hole_or_a_step_back_everything_begins_anew(next_s: float) -> None:
    history = driven((9, 5.0), (10, 5.0), (next_s, 5.0))

    assert history.now is not None
    assert (history.now.travelled_m, history.now.stretch) == (0.0, 1)
    assert history.speeds_mps(np.array([1.0])) == pytest.approx([np.nan], nan_ok=True)


def test_the_same_instant_twice_counts_once() -> None:
    history = driven((0, 5.0), (1, 5.0), (1, 50.0))

    assert history.now is not None
    assert history.now.travelled_m == pytest.approx(5.0)


@given(st.lists(st.tuples(st.floats(0.0, 3.0), st.floats(-5.0, 60.0)), max_size=80))
def test_what_is_remembered_has_an_end_and_the_way_only_grows(steps: list) -> None:
    history, time_s, before = MotionHistory(), 0.0, None
    for step_s, speed in steps:
        time_s += step_s
        history.take(round(time_s * S), speed)
        assert history.now is not None
        if before is not None and before.stretch == history.now.stretch:
            assert history.now.travelled_m >= before.travelled_m
        before = history.now
        assert history._kept[-1].stamp_ns - history._kept[0].stamp_ns <= KEPT_S * S


def test_a_copy_goes_on_alike() -> None:
    one = driven(*((k / 10, 3.0) for k in range(20)))
    other = copy.deepcopy(one)
    for history in (one, other):
        history.take(3 * S, 4.0)

    assert one.now == other.now


@pytest.mark.parametrize("began_ns", [1_262_304_000_123_456_700, 4 * 10**18 - 1])
@given(within_ticks=st.integers(1, 20))
def test_it_is_the_same_whenever_the_drive_began(began_ns: int, within_ticks: int) -> None:
    """Stamps of today are not told apart to the microsecond by a float."""
    early, late = MotionHistory(), MotionHistory()
    for k in range(60):
        early.take(k * S // 5, float(k))
        late.take(began_ns + k * S // 5, float(k))
    ago_s = np.arange(1, 20) / 5.0
    assert np.array_equal(early.recent_mps(within_ticks / 5), late.recent_mps(within_ticks / 5))
    assert len(late.recent_mps(within_ticks / 5)) == within_ticks + 1
    assert np.array_equal(early.speeds_mps(ago_s), late.speeds_mps(ago_s))
