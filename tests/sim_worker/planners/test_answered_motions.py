"""What a stack answered: from when it counts, and when it is asked again."""

from __future__ import annotations

from typing import Any

import msgspec
import numpy as np
import pytest

from foretwin.contracts.planner_link import LINK_VERSION, PlannedMotions
from foretwin.sim_worker.planners.answered_motions import AnsweredMotions
from foretwin.sim_worker.vehicle.parameters import load_vehicle
from tests.sim_worker.planners.driven import at_rest_on, straight, view_of

ROWS = np.arange(2)
TIME_S = np.linspace(0.0, 3.0, 31)
STATES = at_rest_on(straight(), 5.0, 5.0, count=2)


def answer(driven_mps: float, /, **changed: Any) -> PlannedMotions:
    x = np.broadcast_to(5.0 + driven_mps * TIME_S, (2, 31))
    whole = PlannedMotions(
        job=0, question=1, futures=(0, 1), time_s=TIME_S, link=LINK_VERSION,
        xy_m=np.stack([x, np.zeros_like(x)], axis=-1), yaw_rad=np.zeros((2, 31)),
        speed_mps=np.full((2, 31), driven_mps),
    )  # fmt: skip
    return msgspec.structs.replace(whole, **changed)


def asked_at(motions: AnsweredMotions, *, until_s: float, **said: Any) -> list[float]:
    """Ask at every tick of 0.05 s at which it is due; returns when that was."""
    times = []
    for time_s in np.arange(0.0, until_s - 1e-9, 0.05):
        if motions.due(float(time_s)):
            motions.asked(float(time_s))
            times.append(round(float(time_s), 3))
            assert motions.take(answer(5.0, **said), ROWS, float(time_s), STATES) == {}
    return times


@pytest.mark.parametrize(
    ("latency_s", "said", "times"),
    [
        (0.0, {}, [0.0, 0.1, 0.2, 0.3, 0.4]),
        (0.1, {}, [0.0, 0.1, 0.2, 0.3, 0.4]),
        (0.15, {}, [0.0, 0.1, 0.3]),
        (0.0, {"took_s": 0.25}, [0.0, 0.1, 0.4]),
        (0.25, {"took_s": 0.0}, [0.0, 0.1, 0.2, 0.3, 0.4]),
    ],
)
def test_who_is_still_at_it_is_not_asked(
    latency_s: float, said: dict[str, float], times: list[float]
) -> None:
    # The first answer counts at once, as if it had driven before.
    motions = AnsweredMotions(2, rate_hz=10.0, latency_s=latency_s)
    assert asked_at(motions, until_s=0.5, **said) == times


def test_until_an_answer_counts_the_one_before_is_driven() -> None:
    motions = AnsweredMotions(2, rate_hz=10.0, latency_s=0.1)
    view = view_of(straight(), at_rest_on(straight(), 5.0, 5.0, count=2), load_vehicle())

    def accel_at(time_s: float) -> float:
        motions.due(time_s)
        return float(motions.track(view._replace(time_s=time_s), ROWS).accel_mps2[0])

    motions.take(answer(5.0), ROWS, 0.0, STATES)
    slow = accel_at(0.0)
    motions.take(answer(9.0), ROWS, 0.1, STATES)
    assert abs(accel_at(0.15) - slow) < 1.0
    assert accel_at(0.2) > slow + 2.0


def test_rows_without_a_motion_are_named_and_the_others_are_driven() -> None:
    motions = AnsweredMotions(2, rate_hz=10.0, latency_s=0.0)
    spoilt = answer(5.0)
    spoilt.xy_m[1, 3, 0] = np.inf
    assert motions.take(spoilt, ROWS, 0.0, STATES) == {1: "the answer holds what is no number"}
    assert motions.known.tolist() == [True, False]
    assert motions.take(answer(5.0, futures=(1, 0)), ROWS, 0.1, STATES) == {}
    assert motions.known.all()
    motions.forget()
    assert not motions.known.any()


def test_where_no_car_can_be_led_along_is_named_by_its_future() -> None:
    motions = AnsweredMotions(2, rate_hz=10.0, latency_s=0.0)
    backwards, elsewhere = answer(5.0), answer(5.0)
    backwards.speed_mps[0, 10:] = -2.0
    elsewhere.xy_m[1, :, 1] += 11.0
    why = "it drives backwards, at -2.0 m/s: cars of a stack go ahead alone"
    assert motions.take(backwards, ROWS, 0.0, STATES) == {0: why}
    assert motions.known.tolist() == [False, True]
    why = "its motion begins 11 m from its car: xy_m is where base_link is in the World's frame"
    assert motions.take(elsewhere, ROWS, 0.1, STATES) == {1: why}
    late = answer(5.0, time_s=TIME_S + 0.5)
    late.xy_m[..., 0] += 12.0
    assert motions.take(late, ROWS, 0.2, STATES) == {}, "a car of 5 m/s is there by then"


def test_a_motion_that_has_ended_is_driven_no_more_unless_it_came_to_rest() -> None:
    motions = AnsweredMotions(2, rate_hz=10.0, latency_s=0.0)
    stops = answer(5.0)
    stops.speed_mps[1, -1] = 0.0
    motions.take(stops, ROWS, 10.0, STATES)
    assert motions.drop_ended(13.0) == {}
    why = "its motion ended at 13 s, not at rest, before another one counted"
    assert motions.drop_ended(13.05) == {0: why}
    assert motions.known.tolist() == [False, True]
    assert motions.drop_ended(13.1) == {}


@pytest.mark.parametrize(
    ("changed", "words"),
    [
        ({"futures": (0, 0)}, r"futures \(0, 0\) of 2 that were asked for, 0 to 1"),
        ({"futures": (0, 5)}, r"futures \(0, 5\) of 2 that were asked for, 0 to 1"),
        ({"time_s": np.array(1.0)}, "a trajectory needs two or more instants"),
        ({"speed_mps": np.array(3.0)}, r"speed_mps of shape \(\) for 2 futures"),
        ({"xy_m": np.zeros((2, 31))}, r"xy_m of shape \(2, 31\), not \(2, 31, 2\)"),
        ({"xy_m": np.zeros((2, 31, 3))}, r"xy_m of shape \(2, 31, 3\), not \(2, 31, 2\)"),
        ({"time_s": TIME_S - 10.0}, "time_s ends at -7 s; it counts from the question's instant"),
        ({"time_s": TIME_S + 10.0}, "time_s begins at 10 s; it counts from the question's instant"),
        ({"took_s": 5.0}, "time_s ends at 3 s; .* and the answer from 5 s on"),
        ({"took_s": float("nan")}, "took_s nan: 0 to 10 s"),
        ({"took_s": 11.0}, "took_s 11: 0 to 10 s"),
    ],
)
def test_an_answer_of_no_use_is_named(changed: dict[str, Any], words: str) -> None:
    with pytest.raises(ValueError, match=words):
        AnsweredMotions(2, rate_hz=10.0, latency_s=0.0).take(
            answer(5.0, **changed), ROWS, 0.0, STATES
        )
