"""Noisy detections become courses: holes, other ids, clutter, and who stands."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import savgol_filter

from foretwin.contracts.arrays import Array
from foretwin.contracts.drive import RoadUserKind
from foretwin.sim_worker.analysis.occurred import scene
from foretwin.sim_worker.analysis.occurred.scene import Detected, OtherCourse, courses_of
from tests.sim_worker.analysis.occurred.scenes import ego_eastwards, other

RANDOM = np.random.default_rng(7)


def line(seconds: float, *, speed_mps: float = 8.0) -> Array:
    """Somebody who drives north past the crossing, with 0.3 m of noise."""
    time_s = np.arange(0.0, seconds, 0.1)
    exact = np.stack([np.full(len(time_s), 30.0), -40.0 + speed_mps * time_s], axis=1)
    return exact + RANDOM.normal(0.0, 0.3, exact.shape)


def cut(whole: Array, begin: int, end: int, second_kind: RoadUserKind = "car") -> list[Detected]:
    """The same one under two ids, with a hole between."""
    return [
        other("a", whole[:begin]),
        other("b", whole[end:], kind=second_kind, first_s=end / 10.0),
    ]


def courses(*detected: Detected) -> tuple[OtherCourse, ...]:
    return courses_of(detected, ego_eastwards())


def test_a_course_goes_on_behind_a_hole_under_another_id() -> None:
    (course,) = courses(*cut(line(10.0), 50, 62))

    assert course.user_id == "a"
    assert (course.first, len(course.xy_m)) == (0, 100)
    assert course.speed_mps == pytest.approx(np.full(100, 8.0), abs=1.6)
    assert np.abs(course.xy_m[:, 1] - np.linspace(-40.0, 39.2, 100)).max() < 0.8


def test_who_begins_elsewhere_or_is_of_another_class_is_somebody_else() -> None:
    first, second = cut(line(10.0), 50, 62)
    assert len(courses(first, second._replace(xy_m=second.xy_m + np.array([9.0, 0.0])))) == 2
    assert len(courses(*cut(line(10.0), 50, 62, "pedestrian"))) == 2


@pytest.mark.parametrize("count", [3, 4, 7, 90])
@pytest.mark.parametrize("order", [0, 1])
def test_courses_are_smoothed_as_scipy_does(count: int, order: int) -> None:
    xy_m = RANDOM.normal(0.0, 1.0, (count, 2))
    window = min(7, count - (count + 1) % 2)
    expected = savgol_filter(xy_m, window, 2, deriv=order, delta=0.1, axis=0)
    if order == 1:
        half = window // 2
        expected[:half], expected[count - half :] = expected[half], expected[count - half - 1]

    assert scene._smoothed(xy_m, 0.7, order) == pytest.approx(expected, abs=1e-9)


def test_who_stands_at_first_heads_as_it_then_drives_off() -> None:
    time_s = np.arange(0.0, 15.0, 0.1)
    north_m = np.maximum(time_s - 10.0, 0.0) ** 2
    for _ in range(20):
        noise = RANDOM.normal(0.0, 0.3, (len(time_s), 2))
        (course,) = courses(other("a", np.stack([0.0 * time_s, north_m], axis=1) + noise))

        assert course.standing[:80].all()
        assert course.yaw_rad[:80] == pytest.approx(np.full(80, np.pi / 2.0), abs=0.8)


def test_what_shakes_or_is_there_for_a_moment_is_nobody() -> None:
    clutter = other("x", np.full((30, 2), 20.0) + RANDOM.normal(0.0, 4.0, (30, 2)))
    moment = other("y", line(0.9))

    assert courses(clutter, moment) == ()


def test_who_was_there_before_and_after_the_drive_counts_while_it_lasts() -> None:
    ego = ego_eastwards(5.0)
    early = other("a", line(9.0), first_s=-2.0)

    (course,) = courses_of([early], ego)

    assert (course.first, len(course.xy_m)) == (0, 50)


def test_who_stands_does_so_in_all_its_noise_and_heads_as_it_was_told() -> None:
    places = np.full((60, 2), 5.0) + RANDOM.normal(0.0, 0.3, (60, 2))
    parked = other("p", places)._replace(yaw_rad=np.full(60, 1.2))

    (course,) = courses(parked)

    assert course.standing.all()
    assert course.yaw_rad == pytest.approx(np.full(60, 1.2))
