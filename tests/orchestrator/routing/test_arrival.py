from __future__ import annotations

import itertools
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from foretwin.orchestrator.routing.arrival import (
    Arrival,
    BendSpeeds,
    Countdown,
    DrivingPace,
    predict_arrivals,
)
from foretwin.orchestrator.routing.going_on import FADING_S, UNHINDERED_S, USUAL_SHARE
from foretwin.orchestrator.routing.junctions_ahead import UpcomingJunction
from foretwin.orchestrator.routing.route import Route
from foretwin.world_gen.roads.road_graph import DirectedEdge
from tests.orchestrator.grid_map import grid, junctions

TOWN = grid(12, 2)
JUNCTIONS = junctions(TOWN)
ROUTE = Route(tuple(DirectedEdge(TOWN.edges[index], False) for index in range(11)))
LIMIT_MPS = 50 / 3.6
USUAL_MPS = USUAL_SHARE * LIMIT_MPS


def pace_at(speed_mps: float, *, seconds: int = 0) -> DrivingPace:
    pace = DrivingPace()
    for tenth in range(10 * seconds + 1):
        pace.update(tenth * 100_000_000, speed_mps, LIMIT_MPS)
    return pace


def seconds(pace: DrivingPace, *places_m: float, accel_mps2: float = 0.0) -> list[float]:
    return pace.seconds_to(ROUTE, 0.0, places_m, acceleration_mps2=accel_mps2)


def test_at_the_usual_speed_arrival_is_distance_over_speed() -> None:
    near, far = seconds(pace_at(USUAL_MPS), 100.0, 900.0)

    assert near == pytest.approx(100.0 / USUAL_MPS, rel=1e-3)
    assert far == pytest.approx(900.0 / USUAL_MPS, rel=1e-3)


def test_a_driver_who_is_faster_than_usual_arrives_earlier() -> None:
    fast = pace_at(13.5, seconds=200)

    assert fast.share == pytest.approx(13.5 / LIMIT_MPS, abs=0.01)
    assert seconds(fast, 900.0) == pytest.approx([900.0 / 13.5], rel=0.02)


def test_what_a_car_loses_now_fades_as_the_law_says() -> None:
    """Against the law in steps of a millisecond."""
    pace = pace_at(4.0, seconds=20)
    wanted_mps, speed, way_m, at_s = pace.share * LIMIT_MPS, 4.0, 0.0, 0.0
    while way_m < 40.0:
        left = math.exp(-at_s / FADING_S)
        speed += 1e-3 * (-0.5 * left + (1.0 - left) * (wanted_mps - speed) / UNHINDERED_S)
        way_m, at_s = way_m + 1e-3 * speed, at_s + 1e-3

    assert seconds(pace, 40.0, accel_mps2=-0.5) == pytest.approx([at_s], rel=6e-3)


def test_who_was_held_up_is_expected_to_drive_as_usual_again() -> None:
    slow = pace_at(5.0, seconds=20)
    (in_s,) = seconds(slow, 900.0)

    assert 900.0 / USUAL_MPS < in_s < 900.0 / (0.95 * USUAL_MPS) + 2.0 * UNHINDERED_S


def test_who_drives_slowly_for_long_is_believed() -> None:
    slow = pace_at(5.0, seconds=900)

    assert slow.share == pytest.approx(5.0 / LIMIT_MPS, abs=0.02)
    assert seconds(slow, 900.0) == pytest.approx([900.0 / 5.0], rel=0.05)


def test_a_car_that_brakes_comes_later_and_one_that_gains_earlier() -> None:
    found = [seconds(pace_at(8.0), 100.0, accel_mps2=a)[0] for a in (1.0, 0.0, -1.0, -2.0)]

    assert found == sorted(found)
    assert found[-1] - found[0] > 2.0


def test_bends_that_are_known_take_their_time() -> None:
    pace = pace_at(USUAL_MPS)
    bends = BendSpeeds(0.0, np.repeat([20.0, 4.0, 20.0], [60, 20, 100]))
    (straight,) = pace.seconds_to(ROUTE, 0.0, [150.0])
    (bent,) = pace.seconds_to(ROUTE, 0.0, [150.0], bends=bends)

    assert bent - straight > 20.0 / 4.0 - 20.0 / USUAL_MPS
    assert pace.seconds_to(ROUTE, 400.0, [550.0], bends=bends) == pytest.approx([straight])


def test_a_standing_car_is_taken_to_set_off() -> None:
    (in_s,) = seconds(pace_at(0.0), 600.0)

    assert 600.0 / USUAL_MPS + UNHINDERED_S < in_s < 600.0 / USUAL_MPS + 2.0 * UNHINDERED_S


def test_creeping_below_and_above_the_speed_of_standing_hardly_differ() -> None:
    (below,), (above,) = seconds(pace_at(0.45), 40.0), seconds(pace_at(0.55), 40.0)

    assert below - above == pytest.approx(0.0, abs=0.2)


def test_standing_teaches_nothing_about_the_pace() -> None:
    assert pace_at(0.0, seconds=120).share == USUAL_SHARE


@given(speed=st.floats(0.0, 30.0), near=st.floats(1.0, 500.0), more=st.floats(1.0, 500.0))
def test_farther_is_later_and_never_negative(speed: float, near: float, more: float) -> None:
    found = seconds(pace_at(speed), near, near + more)

    assert 0.0 < found[0] < found[1]


def test_what_is_asked_together_is_what_is_asked_alone() -> None:
    pace, places = pace_at(7.0), (30.0, 31.0, 260.0, 261.0, 800.0)
    alone = [seconds(pace, place)[0] for place in places]

    assert seconds(pace, *places) == pytest.approx(alone)
    assert all(b > a for a, b in itertools.pairwise(alone))


def test_arrivals_name_the_junctions_in_order() -> None:
    ahead = [
        UpcomingJunction(junction, 100.0 * number)
        for number, junction in enumerate(JUNCTIONS[:3], start=1)
    ]
    arrivals = predict_arrivals(ROUTE, 0.0, ahead, pace_at(8.0))

    assert [arrival.junction for arrival in arrivals] == [a.junction for a in ahead]
    assert sorted(a.in_s for a in arrivals) == [a.in_s for a in arrivals]
    assert predict_arrivals(ROUTE, 0.0, [], pace_at(8.0)) == ()


def shown(expected: list[float | None], *, junction: int = 0) -> list[float | None]:
    """What a countdown shows of expectations a tenth of a second apart; None: the car stands."""
    countdown, found = Countdown(), []
    for number, in_s in enumerate(expected):
        arrival = Arrival(JUNCTIONS[junction], 50.0, 0.0 if in_s is None else in_s)
        countdown.update(number * 100_000_000, arrival, waiting=in_s is None)
        found.append(countdown.in_s)
    return found


def test_a_countdown_counts_down() -> None:
    expected = [10.0 - 0.1 * n for n in range(50)]

    assert shown(list(expected)) == pytest.approx(expected)


def test_a_countdown_does_not_jump_but_follows() -> None:
    found = shown([10.0 - 0.1 * n for n in range(20)] + [16.0 - 0.1 * n for n in range(20, 60)])
    steps = np.diff(np.array(found, dtype=np.float64))

    assert np.abs(steps).max() < 0.7
    assert found[-1] == pytest.approx(16.0 - 5.9, abs=0.2)


def test_nothing_is_counted_down_while_the_car_stands_and_then_anew() -> None:
    found = shown([5.0, 4.9, None, None, 9.0, 8.9])

    assert found[2:4] == [None, None]
    assert found[4:] == pytest.approx([9.0, 8.9])


def test_another_junction_begins_a_countdown_of_its_own() -> None:
    countdown = Countdown()
    countdown.update(0, Arrival(JUNCTIONS[0], 5.0, 1.0), waiting=False)
    countdown.update(100_000_000, Arrival(JUNCTIONS[1], 105.0, 11.0), waiting=False)
    assert countdown.in_s == 11.0
    countdown.update(200_000_000, None, waiting=False)
    assert countdown.in_s is None
