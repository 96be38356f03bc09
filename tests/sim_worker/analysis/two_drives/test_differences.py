"""Two drives of one road, against closed forms."""

from __future__ import annotations

from functools import partial

import msgspec
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from foretwin.sim_worker.analysis.two_drives.differences import (
    DriveDifference,
    difference_of_drives,
    spread,
)
from tests.sim_worker.analysis.two_drives.drawn_drives import BEND, LOOP, driven, line

STRAIGHT = np.array([[0.0, 0.0], [500.0, 0.0]])


def compared(*drives: object, same_drive: bool = False) -> DriveDifference:
    found = difference_of_drives(*drives, same_drive=same_drive)  # type: ignore[arg-type]
    assert found is not None
    return found


@settings(max_examples=15, deadline=None)
@given(
    left_m=st.floats(-3.0, 3.0),
    speeds=st.tuples(st.floats(5.0, 20.0), st.floats(5.0, 20.0)),
)
def test_beside_each_other_at_other_speeds(left_m: float, speeds: tuple[float, float]) -> None:
    a, b = line(driven(BEND, speeds[0])), line(driven(BEND, speeds[1], left_m=left_m))
    found = compared(a, b)
    lateral, speed = found.spreads["lateral_m"], found.spreads["speed_mps"]
    assert lateral.quantiles == pytest.approx([left_m] * 5, abs=0.25)
    assert speed.quantiles == pytest.approx([speeds[1] - speeds[0]] * 5, abs=1e-6)
    expected_s = 100.0 / speeds[1] - 100.0 / speeds[0]
    # In the bend who drives inside has a shorter way.
    bent_s = 100.0 / 60.0 * abs(left_m) / min(speeds)
    assert found.spreads["time_per_100m_s"].quantiles[2] == pytest.approx(
        expected_s, abs=0.4 + bent_s
    )


def test_changing_sides_changes_the_sign() -> None:
    a, b = line(driven(STRAIGHT, 8.0)), line(driven(STRAIGHT, lambda m: 9.0 + m / 200, left_m=1.0))
    there, back = compared(a, b), compared(b, a)
    for name in ("lateral_m", "speed_mps", "time_per_100m_s"):
        mirrored = [-q for q in back.spreads[name].quantiles[::-1]]
        assert there.spreads[name].quantiles == pytest.approx(mirrored, abs=0.15)


def test_a_stop_is_time_and_no_way() -> None:
    a, b = line(driven(STRAIGHT, 10.0)), line(driven(STRAIGHT, 10.0, stands=(250.0, 30.0)))
    (one,) = compared(a, b).stretches
    assert one.b_s[-1] - one.a_s[-1] == pytest.approx(30.0, abs=0.3)
    over = one.values["time_per_100m_s"]
    assert over[100] == pytest.approx(0.0, abs=0.3)
    assert over[200] == pytest.approx(30.0, abs=0.3)
    assert np.isnan(over[-50:]).all()


def test_what_comes_after_a_place_is_compared_from_like_speeds() -> None:
    """From the same 10 m/s one speeds up by 0.5 m/s² by way of place, the other keeps its speed."""
    faster = line(driven(STRAIGHT, lambda m: float(np.sqrt(100.0 + 1.0 * m)), left_m=1.0))
    found = compared(line(driven(STRAIGHT, 10.0)), faster)
    two = next(row for row in found.after if row.horizon_s == 2.0)
    # Only the first 11 m are passed within 0.5 m/s: a second of it.
    assert 1 <= two.along.places <= 2
    assert two.along.quantiles[0] == pytest.approx(0.5 * 0.5 * 2.0**2, abs=0.3)
    assert two.speed.quantiles[0] == pytest.approx(1.0, abs=0.3)
    assert two.across.rms == pytest.approx(0.0, abs=0.02)


def test_who_is_faster_does_not_drop_out_where_a_stretch_ends() -> None:
    """From 10 m/s one goes on as fast, the other as often at 15 m/s as at 6 m/s, on 110 m each."""
    ways = [np.array([[0.0, 400.0 * k], [110.0, 400.0 * k]]) for k in range(8)]
    a, b = [], []
    for k, way in enumerate(ways):
        then_mps = 15.0 if k % 2 else 6.0
        a += driven(way, 10.0, start_s=60.0 * k)
        b += driven(way, partial(_after_5_m, then_mps), start_s=60.0 * k, left_m=1.0)
    after = {row.horizon_s: row for row in compared(line(a), line(b)).after}
    assert after[4.0].along.places == 8
    slower_m, faster_m = np.array(after[4.0].along.quantiles)[[0, -1]]
    assert faster_m > 15.0
    assert slower_m < -12.0
    # In 8 s a car at 15 m/s leaves any of them, so that the slower ones say nothing alone.
    assert (after[8.0].along.places, after[8.0].left_out) == (0, 8)
    assert [after[s].along.places + after[s].left_out for s in (1.0, 2.0, 4.0, 8.0)] == [8] * 4


def _after_5_m(then_mps: float, at_m: float) -> float:
    return 10.0 if at_m < 5.0 else then_mps


def test_a_stretch_is_long_enough_for_cars_that_speed_up_from_where_they_are() -> None:
    """From 3 m/s nobody goes 100 m in 8 s by speeding up to 15 m/s; who has 15 m/s goes 120."""
    slow, fast = np.array([[0.0, 0.0], [115.0, 0.0]]), np.array([[0.0, 400.0], [115.0, 400.0]])
    both = driven(slow, 3.0) + driven(fast, 15.0, start_s=60.0)
    eight = compared(line(both), line(both)).after[-1]
    # 8 s at 15 m/s, less 4 s of speeding up, are 96 m: the first 19 m, at 3 m/s, are far enough.
    assert 5 <= eight.along.places <= 7
    assert eight.left_out > 30


def test_what_is_common_counts_each_metre_once_and_the_rest_is_alone() -> None:
    longer = np.array([[-200.0, 0.0], [500.0, 0.0]])
    found = compared(line(driven(STRAIGHT, 8.0)), line(driven(longer, 8.0)))
    assert found.common_a_m == pytest.approx(found.a_m, abs=12.0)
    assert found.b_m - found.common_b_m == pytest.approx(200.0, abs=12.0)
    laps = line(driven(np.concatenate([LOOP, LOOP[1:]]), 8.0))
    once = compared(laps, line(driven(LOOP, 8.0)))
    assert once.common_b_m == pytest.approx(480.0, abs=12.0)
    assert once.common_a_m == pytest.approx(960.0, abs=24.0)
    itself = compared(laps, laps, same_drive=True)
    assert itself.common_a_m == itself.common_b_m == pytest.approx(960.0, abs=24.0)


def test_nothing_in_common_is_none() -> None:
    away = line(driven(STRAIGHT + np.array([0.0, 400.0]), 8.0))
    assert difference_of_drives(line(driven(STRAIGHT, 8.0)), away) is None


def test_the_other_way_round_is_told_from_30_m_on() -> None:
    there_and_back = np.array([[0.0, 0.0], [300.0, 0.0], [300.0, 4.0], [0.0, 4.0]])
    states = driven(there_and_back, 8.0)
    found = compared(line(driven(STRAIGHT, 8.0)), line(states))
    assert found.opposite_m == pytest.approx(300.0, abs=20.0)
    stopped = [s for s in states if s.stamp_ns < 40e9]  # 16 m into the way back
    assert compared(line(driven(STRAIGHT, 8.0)), line(stopped)).opposite_m == 0.0


def test_accelerations_are_those_of_the_states() -> None:
    gentle = [msgspec.structs.replace(s, accel_mps2=0.7) for s in driven(STRAIGHT, 8.0)]
    found = compared(line(driven(STRAIGHT, 8.0)), line(gentle))
    assert found.spreads["accel_mps2"].rms == pytest.approx(0.7)


def test_a_spread_of_nothing_says_so() -> None:
    found = spread(np.array([np.nan, np.nan]))
    assert found.places == 0
    known = spread(np.array([np.nan, -1.0, 1.0, 3.0]))
    assert (known.places, known.quantiles[2]) == (3, 1.0)
    assert known.rms == pytest.approx(np.sqrt(11 / 3))
    assert known.size_p95 == pytest.approx(2.8)
