"""Who is dangerous, from where, how likely: read off rounds drawn by hand."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from foretwin.contracts.arrays import Array
from foretwin.contracts.simulation import AMBER_FROM, GREEN_TO, RED_FROM
from foretwin.viewer.danger import Danger, SteadyLevel, dangers_of, level_of
from tests.viewer.copilot.rounds import HORIZON_S, POINTS, TIMES_S, line, round_of


@pytest.mark.parametrize(
    ("track", "said"),
    [
        (line((20.0, -20.0), (0.0, 10.0)), "from the right"),
        (line((20.0, 20.0), (0.0, -10.0)), "from the left"),
        (line((40.0, 0.0), (-10.0, 0.0)), "oncoming"),
        (line((20.0, 0.0), (3.0, 0.0)), "ahead"),
        (line((-20.0, 0.0), (20.0, 0.0)), "from behind"),
        (line((20.0, 0.5), (0.0, 0.0)), "ahead"),
        (line((10.0, -10.0), (7.2, 7.0)), "ahead"),
        (line((10.0, -10.0), (6.8, 7.0)), "from the right"),
    ],
)
def test_it_says_from_where_somebody_comes(track: Array, said: str) -> None:
    (danger,) = dangers_of(round_of(("car", track, 2.0 * RED_FROM)))
    assert danger.what == f"car {said}"
    assert (danger.in_s, danger.hits, danger.level) == (2.0, True, "danger")
    assert danger.likelihood == pytest.approx(0.12)


def test_sides_are_those_of_the_car_as_they_meet_not_of_the_map() -> None:
    """The car turns left onto a road going north; somebody on foot walks west across it."""
    angle = np.minimum(TIMES_S, 2.0) / 2.0 * math.pi / 2.0
    own = np.column_stack([10.0 * np.sin(angle), 10.0 * (1.0 - np.cos(angle))])
    (danger,) = dangers_of(round_of(("pedestrian", line((13.0, 10.0), (-1.5, 0.0)), 1e-3), own=own))
    assert danger.what == "pedestrian from the right"


def test_likelihood_times_severity_ranks_and_who_says_the_same_is_told_once() -> None:
    right, left = line((20.0, -20.0), (0.0, 10.0)), line((20.0, 20.0), (0.0, -10.0))
    view = round_of(
        ("car", right, 2e-6), ("bicycle", left, 3e-5), ("car", right, 5e-6), static=1e-7
    )
    assert [(one.what, one.future, one.level) for one in dangers_of(view)] == [
        ("bicycle from the left", 2, "watch"),
        ("car from the right", 3, "watch"),
        ("fixed object", 4, "calm"),
    ]


def test_what_nobody_dies_of_and_what_is_late_is_no_danger() -> None:
    right = line((20.0, -20.0), (0.0, 10.0))
    assert dangers_of(round_of(("car", right, GREEN_TO * 0.9))) == ()
    assert dangers_of(round_of(("car", right, 1.0), late=True)) == ()
    near = dangers_of(round_of(("unknown", right, 1e-5), hits=False))
    assert [(one.what, one.hits) for one in near] == [("somebody from the right", False)]


def test_a_round_that_does_not_tell_its_span_still_says_something() -> None:
    import msgspec

    view = round_of(("car", line((20.0, -20.0), (0.0, 10.0)), 1e-3))
    (danger,) = dangers_of(msgspec.structs.replace(view, horizon_s=0.0))
    assert danger.what == "car from the right"
    assert len(TIMES_S) == POINTS
    assert TIMES_S[-1] == HORIZON_S


def test_levels_are_those_of_the_one_table() -> None:
    levels = [level_of(one) for one in (0.0, AMBER_FROM, RED_FROM * 0.99, RED_FROM)]
    assert levels == ["calm", "watch", "watch", "danger"]


def test_a_level_rises_at_once_and_falls_when_it_stays_down() -> None:
    level = SteadyLevel()
    told = [level.take(one) for one in ("calm", "danger", "calm", "danger", "calm", "watch")]
    assert told == ["calm", "danger", "danger", "danger", "danger", "watch"]
    level.forget()
    assert level.shown == "none"
    assert level.take("calm") == "calm"


@pytest.mark.parametrize(
    ("likelihood", "said"),
    [
        (1.0, "100 %"),
        (0.124, "12 %"),
        (0.01, "1 %"),
        (0.0049, "1 in 200"),
        (0.001, "1 in 1000"),
        (0.0004, "rare"),
        (0.0, "rare"),
    ],
)
def test_likelihoods_have_the_digits_that_count(likelihood: float, said: str) -> None:
    assert with_likelihood(likelihood).odds == said


@given(st.floats(0.0, 1.0))
def test_a_likelihood_is_never_said_in_more_than_nine_letters(likelihood: float) -> None:
    assert 1 < len(with_likelihood(likelihood).odds) <= 9


def with_likelihood(likelihood: float) -> Danger:
    return Danger(0, "car from the right", likelihood, 1e-3, 2.1, True, "danger")
