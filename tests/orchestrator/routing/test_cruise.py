from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from foretwin.orchestrator.routing.cruise import LEAD_S, CruiseSpeed


def after(speeds: list[float], *, step_s: float = 0.1) -> CruiseSpeed:
    cruise = CruiseSpeed()
    for number, speed in enumerate(speeds):
        cruise.update(round(number * step_s * 1e9), speed)
    return cruise


def test_a_steady_car_keeps_its_speed() -> None:
    assert after([8.0] * 20).aim_mps() == pytest.approx(8.0)


def test_a_standing_car_stays_standing() -> None:
    assert after([0.0] * 20).aim_mps(13.9) == 0.0


@given(
    accel=st.floats(-3.0, 3.0),
    start=st.floats(10.0, 20.0),
    step_s=st.sampled_from([0.01, 0.1, 0.2]),
)
def test_acceleration_is_the_slope_of_the_last_second(
    accel: float, start: float, step_s: float
) -> None:
    speeds = [start + accel * number * step_s for number in range(round(1.5 / step_s))]
    cruise = after(speeds, step_s=step_s)

    assert cruise.acceleration_mps2 == pytest.approx(accel, abs=1e-6)
    assert cruise.aim_mps() == pytest.approx(max(0.0, speeds[-1] + LEAD_S * accel), abs=1e-5)


def test_an_accelerating_car_does_not_aim_above_the_limit() -> None:
    assert after([10.0 + 0.2 * n for n in range(10)]).aim_mps(12.5) == 12.5


def test_a_car_above_the_limit_keeps_its_speed() -> None:
    assert after([15.0] * 10).aim_mps(8.3) == pytest.approx(15.0)


def test_braking_hard_aims_at_standing() -> None:
    assert after([5.0 - 0.4 * n for n in range(10)]).aim_mps() == 0.0


def test_what_is_older_than_a_second_tells_no_acceleration() -> None:
    assert after([0.0] * 30 + [8.0] * 11).acceleration_mps2 == 0.0
    assert after([0.0] * 30 + [8.0] * 10).acceleration_mps2 > 1.0


def test_a_gap_in_the_data_forgets_the_trend() -> None:
    cruise = after([2.0, 4.0, 6.0, 8.0], step_s=0.2)
    cruise.update(10_000_000_000, 8.0)

    assert cruise.acceleration_mps2 == 0.0
    assert cruise.aim_mps() == 8.0


def test_the_same_stamp_twice_counts_once() -> None:
    cruise = after([3.0] * 10)
    cruise.update(900_000_000, 9.0)

    assert cruise.aim_mps() == pytest.approx(3.0)


def test_nothing_seen_aims_at_nothing() -> None:
    assert CruiseSpeed().aim_mps() == 0.0
