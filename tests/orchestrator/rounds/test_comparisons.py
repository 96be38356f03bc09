"""The nominal future against what the car did, once reality has caught up."""

from __future__ import annotations

import msgspec
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from foretwin.contracts.drive import VehicleState
from foretwin.contracts.frames import GeoPoint, LocalFrame
from foretwin.contracts.simulation import Comparison
from foretwin.orchestrator.record.bookkeeping import ComparisonCount
from foretwin.orchestrator.rounds.comparisons import OpenComparisons
from tests.orchestrator.futures_rounds import round_done, straight
from tests.orchestrator.trip import START_NS, states_along

COVERS = ("foretwin.contracts.simulation",)

DRIVE = LocalFrame(GeoPoint(52.5, 13.4))
WORLD = LocalFrame(GeoPoint(52.503, 13.405))


def car(frame: LocalFrame, *, length_m: float = 200.0, heading_rad: float = 0.0) -> list:
    """States of a car that drives straight on at 10 m/s, from 2 s before the round."""
    ahead = np.array([np.cos(heading_rad), np.sin(heading_rad)])
    return states_along(frame, np.outer([-20.0, length_m], ahead), start_s=-2.0)


def compared(
    states: list[VehicleState], done: object, *, world: LocalFrame = DRIVE, flush: bool = True
) -> dict[float, Comparison]:
    handler = OpenComparisons(DRIVE, 8.0)
    found = []
    for state in states:
        found += handler.take_state(state)
        if state.stamp_ns == START_NS:
            handler.take_round(done, world, state)  # type: ignore[arg-type]
    if flush:
        found += handler.flush()
    return {c.horizon_s: c for c in found}


def test_a_future_that_came_true_has_no_error() -> None:
    found = compared(car(DRIVE), round_done(straight()), flush=False)

    assert set(found) == {1.0, 2.0, 4.0, 8.0}
    for comparison in found.values():
        assert comparison.nominal.ade_m == pytest.approx(0.0, abs=1e-4)
        assert comparison.nominal.heading_rad == pytest.approx(0.0, abs=1e-5)
        assert comparison.constant_velocity.fde_m == pytest.approx(0.0, abs=1e-4)
        assert comparison.intersection_id == "n4"


@given(heading=st.floats(-3.1, 3.1))
def test_a_future_a_metre_to_the_left_is_a_metre_off_whatever_the_heading(heading: float) -> None:
    left = (-float(np.sin(heading)), float(np.cos(heading)))
    done = round_done(straight(left, yaw_rad=heading))
    found = compared(car(DRIVE, heading_rad=heading), done)

    for comparison in found.values():
        assert comparison.nominal.lateral_m == pytest.approx(1.0, abs=1e-3)
        assert comparison.nominal.longitudinal_m == pytest.approx(0.0, abs=1e-3)
        assert comparison.nominal.ade_m == pytest.approx(1.0, abs=1e-3)


def test_a_future_that_is_too_fast_ends_ahead() -> None:
    found = compared(car(DRIVE), round_done(straight(speed_mps=11.0)))

    assert found[4.0].nominal.longitudinal_m == pytest.approx(4.0, abs=1e-3)
    assert found[8.0].nominal.fde_m == pytest.approx(8.0, abs=1e-3)
    assert found[4.0].nominal.lateral_m == pytest.approx(0.0, abs=1e-3)


def test_the_worlds_frame_makes_no_difference() -> None:
    """The future lies in its World's frame, the car's track in that of the drive."""
    found = compared(car(WORLD), round_done(straight()), world=WORLD)

    assert found[8.0].nominal.ade_m == pytest.approx(0.0, abs=1e-3)


def test_what_a_map_moves_the_position_by_is_no_error_of_the_future() -> None:
    """From 3 s on the car is found 2 m further north; it has not driven there."""
    states = car(DRIVE)
    for k, state in enumerate(states):
        if state.stamp_ns > START_NS + 3_000_000_000:
            place = state.position
            north = GeoPoint(place.lat_deg + 2.0 / 111_266.0, place.lon_deg)
            states[k] = msgspec.structs.replace(state, position=north, map_shift_m=(0.0, 2.0))
    found = compared(states, round_done(straight()))

    for comparison in found.values():
        assert comparison.nominal.ade_m == pytest.approx(0.0, abs=2e-3)


def test_nothing_is_compared_before_the_longest_horizon_has_passed() -> None:
    nearly = [s for s in car(DRIVE) if s.stamp_ns < START_NS + 7_950_000_000]

    assert compared(nearly, round_done(straight()), flush=False) == {}
    assert set(compared(car(DRIVE), round_done(straight()), flush=False)) == {1.0, 2.0, 4.0, 8.0}


def test_at_the_end_the_horizons_that_were_covered_count() -> None:
    short = [s for s in car(DRIVE) if s.stamp_ns <= START_NS + 5_000_000_000]

    assert set(compared(short, round_done(straight()))) == {1.0, 2.0, 4.0}


def test_nothing_is_said_across_a_hole_in_the_track() -> None:
    holed = [s for s in car(DRIVE) if not 2.5e9 < s.stamp_ns - START_NS < 4.6e9]

    assert set(compared(holed, round_done(straight()))) == {1.0, 2.0}


def test_a_short_future_is_compared_over_its_own_horizons() -> None:
    handler = OpenComparisons(DRIVE, 4.0)

    assert handler.horizons_s == (1.0, 2.0, 4.0)


def test_positions_without_a_heading_are_no_truth() -> None:
    blind = states_along(DRIVE, np.array([[-20.0, 0.0], [200.0, 0.0]]), yaw_valid=False)

    assert compared(blind, round_done(straight())) == {}


def test_a_comparison_looks_no_further_than_its_horizon() -> None:
    """Cut later or not, the log gives the same numbers to the last bit."""
    whole = car(DRIVE, length_m=400.0)
    cut = [s for s in whole if s.stamp_ns <= START_NS + 8_000_000_000]

    assert compared(whole, round_done(straight())) == compared(cut, round_done(straight()))


def test_the_track_is_forgotten_when_nobody_needs_it() -> None:
    handler = OpenComparisons(DRIVE, 8.0)
    for number, state in enumerate(states_along(DRIVE, np.array([[0.0, 0.0], [1000.0, 0.0]]))):
        if number % 7:  # not all come
            handler.take_state(state)
            handler.take_state(state)  # and some twice

    stamps_ns = handler._driven.stamps_ns.tolist()
    assert stamps_ns == sorted(set(stamps_ns))
    assert len(stamps_ns) < 10 * 15


def test_after_the_clock_has_stepped_back_comparisons_go_on() -> None:
    handler = OpenComparisons(DRIVE, 8.0)
    hour_ns = 3600 * 10**9
    for state in car(DRIVE)[:10]:
        later = msgspec.structs.replace(state, stamp_ns=state.stamp_ns + hour_ns)
        assert handler.take_state(later) == []
    found = []
    for state in car(DRIVE):
        found += handler.take_state(state)
        if state.stamp_ns == START_NS:
            handler.take_round(round_done(straight()), DRIVE, state)
    assert {comparison.horizon_s for comparison in found} == {1.0, 2.0, 4.0, 8.0}


@pytest.mark.parametrize(("back_s", "goes_on"), [(0.9, True), (1.1, False)])
def test_a_stamp_that_is_more_than_a_second_old_is_a_clock_set_anew(
    back_s: float, goes_on: bool
) -> None:
    handler, found = OpenComparisons(DRIVE, 8.0), []
    for state in car(DRIVE):
        found += handler.take_state(state)
        if state.stamp_ns == START_NS:
            handler.take_round(round_done(straight()), DRIVE, state)
        if state.stamp_ns == START_NS + 2_000_000_000:
            old_ns = state.stamp_ns - round(back_s * 1e9)
            assert handler.take_state(msgspec.structs.replace(state, stamp_ns=old_ns)) == []
    assert len(found) == (4 if goes_on else 0)


def test_a_second_round_of_one_state_is_no_further_evidence() -> None:
    handler, found = OpenComparisons(DRIVE, 8.0), []
    for state in car(DRIVE):
        found += handler.take_state(state)
        if 0 <= state.stamp_ns - START_NS <= 100_000_000:
            for round_id in (0, 1):
                done = round_done(straight(), round_id=round_id, stamp_ns=state.stamp_ns)
                handler.take_round(done, DRIVE, state)

    assert len(found) == 2 * 4
    assert {one.round_id for one in found} == {0}


def test_the_mean_future_is_weighed_by_how_likely_futures_are() -> None:
    """One stays on the way, one lies 4 m to the left and is a third as likely, one is lost."""
    lost = straight((0.0, 0.0))
    lost[:] = np.nan
    done = round_done(np.concatenate([straight(), straight((0.0, 4.0)), lost]))
    handler = OpenComparisons(DRIVE, 8.0)
    found = []
    for state in car(DRIVE):
        found += handler.take_state(state)
        if state.stamp_ns == START_NS:
            handler.take_round(done, DRIVE, state, np.array([0.3, 0.1, 0.0]))

    assert [one.weighted_ade_m for one in found] == pytest.approx([1.0] * 4, abs=1e-3)
    count = ComparisonCount()
    for one in found:
        count.take(one)
    assert count.record(independent=False)["weighted_ade_m"]["8"] == pytest.approx(1.0, abs=1e-3)


def test_where_no_future_is_likely_there_is_no_mean() -> None:
    handler = OpenComparisons(DRIVE, 8.0)
    found = []
    for state in car(DRIVE):
        found += handler.take_state(state)
        if state.stamp_ns == START_NS:
            handler.take_round(round_done(straight()), DRIVE, state, np.zeros(1))

    assert [one.weighted_ade_m for one in found] == [None] * 4
