"""Heights and grades between the places of a profile, and of open ground between its samples."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.interpolate import CubicHermiteSpline, RegularGridInterpolator

from foretwin.contracts.codec import decode, encode
from foretwin.contracts.elevation import Elevation, HeightProfile

HILL = HeightProfile(
    id="r",
    along_m=np.array([0.0, 10.0, 30.0]),
    height_m=np.array([0.0, 1.0, 1.0]),
    grade=np.array([0.0, 0.1, 0.0]),
)
FIELD = Elevation(
    source="drawn",
    base_m=100.0,
    grade_std=0.027,
    roads=(HILL,),
    connections=(),
    ground_from_m=(-10.0, 0.0),
    ground_step_m=10.0,
    ground_m=np.array([[0.0, 1.0, 2.0], [10.0, 11.0, 12.0]]),
)


def test_a_profile_passes_its_places_with_their_grades_and_is_held_at_its_ends() -> None:
    at = np.array([-5.0, 0.0, 10.0, 30.0, 99.0])

    assert HILL.height_at(at) == pytest.approx([0.0, 0.0, 1.0, 1.0, 1.0])
    assert HILL.grade_at(at) == pytest.approx([0.0, 0.0, 0.1, 0.0, 0.0])


def test_grades_are_what_heights_change_by() -> None:
    at = np.linspace(0.5, 29.5, 59)
    change = (HILL.height_at(at + 1e-4) - HILL.height_at(at - 1e-4)) / 2e-4

    assert HILL.grade_at(at) == pytest.approx(change, abs=1e-6)


@given(
    steps_m=st.lists(st.floats(0.5, 40.0), min_size=1, max_size=5),
    seed=st.integers(0, 999),
)
def test_between_its_places_a_profile_is_hermites_cubic(steps_m: list[float], seed: int) -> None:
    random = np.random.default_rng(seed)
    along_m = 3.0 + np.cumsum([0.0, *steps_m])
    height_m, grade = random.normal(0.0, 5.0, (2, len(along_m)))
    profile = HeightProfile(id="r", along_m=along_m, height_m=height_m, grade=grade)
    cubic = CubicHermiteSpline(along_m, height_m, grade)
    at = np.linspace(along_m[0], along_m[-1], 41)

    assert profile.height_at(at) == pytest.approx(cubic(at), abs=1e-6)
    assert profile.grade_at(at) == pytest.approx(cubic(at, 1), abs=1e-6)
    assert profile.cubics() == pytest.approx(cubic.c[::-1].T, abs=1e-6)


def test_two_places_at_one_spot_are_a_step_and_no_division_by_nothing() -> None:
    step = HeightProfile(
        id="r",
        along_m=np.array([0.0, 5.0, 5.0, 9.0]),
        height_m=np.array([1.0, 1.0, 3.0, 3.0]),
        grade=np.zeros(4),
    )
    assert step.height_at(np.array([4.99, 5.0, 5.01])) == pytest.approx([1.0, 3.0, 3.0], abs=1e-4)


def test_cubics_are_those_of_opendrive() -> None:
    a, b, c, d = HILL.cubics()[0]

    assert a + b * 10.0 + c * 100.0 + d * 1000.0 == pytest.approx(1.0)


def test_the_ground_is_bilinear_and_held_at_its_edge() -> None:
    xy = np.array([[-10.0, 0.0], [0.0, 10.0], [5.0, 5.0], [99.0, 99.0]])

    assert FIELD.ground_at(xy) == pytest.approx([0.0, 11.0, 6.5, 12.0])


@given(st.integers(0, 999))
def test_ground_lies_between_its_four_samples_wherever_they_are(seed: int) -> None:
    random = np.random.default_rng(seed)
    ground_m = random.normal(0.0, 9.0, (4, 3))
    field = Elevation(
        source="drawn",
        base_m=0.0,
        grade_std=0.0,
        roads=(),
        connections=(),
        ground_from_m=(-7.0, 11.0),
        ground_step_m=2.5,
        ground_m=ground_m,
    )
    xy = random.uniform((-12.0, 6.0), (3.0, 24.0), (40, 2))
    held = np.clip(xy, (-7.0, 11.0), (-2.0, 18.5))
    axes = (np.array([11.0, 13.5, 16.0, 18.5]), np.array([-7.0, -4.5, -2.0]))

    wanted = RegularGridInterpolator(axes, ground_m)(held[:, ::-1])
    assert field.ground_at(xy) == pytest.approx(wanted, abs=1e-9)


def test_it_comes_back_from_the_wire_as_it_went() -> None:
    again = decode(encode(FIELD), Elevation).message

    assert again.ground_m.tolist() == FIELD.ground_m.tolist()
    assert again.roads[0].height_at(np.array([5.0])) == HILL.height_at(np.array([5.0]))
