import numpy as np
import pytest

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


def test_cubics_are_those_of_opendrive() -> None:
    a, b, c, d = HILL.cubics()[0]

    assert a + b * 10.0 + c * 100.0 + d * 1000.0 == pytest.approx(1.0)


def test_the_ground_is_bilinear_and_held_at_its_edge() -> None:
    xy = np.array([[-10.0, 0.0], [0.0, 10.0], [5.0, 5.0], [99.0, 99.0]])

    assert FIELD.ground_at(xy) == pytest.approx([0.0, 11.0, 6.5, 12.0])


def test_it_comes_back_from_the_wire_as_it_went() -> None:
    again = decode(encode(FIELD), Elevation).message

    assert again.ground_m.tolist() == FIELD.ground_m.tolist()
    assert again.roads[0].height_at(np.array([5.0])) == HILL.height_at(np.array([5.0]))
