from __future__ import annotations

import gc
import math
import pickle
import weakref

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from foretwin.geometry.frenet_path import FrenetPath

COVERS = ("foretwin.geometry.compiled",)

ARC = np.linspace(0.0, 1.5 * math.pi, 200)
CIRCLE = FrenetPath(20.0 * np.stack([np.sin(ARC), 1.0 - np.cos(ARC)], axis=1))


@settings(deadline=None)
@given(st.floats(2.0, 90.0), st.floats(-5.0, 5.0))
def test_a_point_is_found_where_it_was_put(arc_m: float, offset_m: float) -> None:
    point = CIRCLE.point_at(np.array([arc_m]), offset_m)
    for near in (None, np.array([arc_m - 3.0])):
        place = CIRCLE.locate(point, near_arc_m=near)
        assert place.arc_m[0] == pytest.approx(arc_m, abs=0.15)
        assert place.offset_m[0] == pytest.approx(offset_m, abs=0.02)


def test_a_circle_has_its_curvature_and_the_speed_that_follows() -> None:
    inside = (CIRCLE.arc_m > 5.0) & (CIRCLE.arc_m < CIRCLE.length_m - 5.0)
    assert CIRCLE.curvature_pm[inside] == pytest.approx(1.0 / 20.0, rel=0.01)
    profile = CIRCLE.speed_profile(lateral_accel_mps2=2.0, decel_mps2=2.0)
    assert profile[inside] == pytest.approx(math.sqrt(40.0), rel=0.01)


def test_the_speed_profile_brakes_ahead_of_a_curve() -> None:
    start = np.stack([np.arange(-80.0, 0.0), np.zeros(80)], axis=1)
    arc = 20.0 * np.stack([np.sin(ARC), 1.0 - np.cos(ARC)], axis=1)
    path = FrenetPath(np.concatenate([start, arc]))
    profile = path.speed_profile(lateral_accel_mps2=2.0, decel_mps2=2.0)
    at_50 = path.at_nodes(profile, np.array([50.0]))[0]
    assert at_50 == pytest.approx(math.sqrt(40.0 + 2 * 2.0 * 29.0), rel=0.05)


def test_a_path_that_nobody_follows_holds_what_it_was_made_of_alone() -> None:
    def held_bytes(path: FrenetPath) -> int:
        return sum(one.nbytes for one in vars(path).values() if isinstance(one, np.ndarray))

    path = FrenetPath(np.array([[0.0, 0.0], [10.0, 0.0]]), np.array([8.0, 8.0]))
    assert held_bytes(path) < 100
    path.point_at(np.array([3.0]))
    assert held_bytes(path) > 8 * 8 * len(path.arc_m)


def test_an_eased_corner_is_another_path_in_all_that_it_is_asked() -> None:
    path = FrenetPath(np.array([[0.0, 0.0], [30.0, 0.0], [30.0, 30.0]]))
    at, bounds = np.array([29.0, 31.0]), {"lateral_accel_mps2": 2.0, "decel_mps2": 2.0}
    plain, slow = path.pose_at(at), path.speed_profile(**bounds)
    eased, brisk = path.eased.pose_at(at), path.eased.speed_profile(**bounds)
    assert np.hypot(*(eased.xy_m - plain.xy_m).T).min() > 0.2
    assert np.abs(eased.yaw_rad - plain.yaw_rad).max() > 0.1
    assert path.eased.locate(eased.xy_m).offset_m == pytest.approx(0.0, abs=1e-9)
    assert brisk.min() > slow.min() + 0.1


def test_a_path_goes_on_straight_beyond_both_ends() -> None:
    path = FrenetPath(np.array([[0.0, 0.0], [10.0, 0.0]]))
    assert path.point_at(np.array([-5.0, 60.0])) == pytest.approx(np.array([[-5.0, 0], [60.0, 0]]))


def test_a_path_that_crosses_itself_is_followed_and_not_jumped_along() -> None:
    turn = np.linspace(0.0, 1.5 * math.pi, 60)
    loop = np.concatenate(
        [
            np.stack([np.arange(-30.0, 20.0), np.zeros(50)], axis=1),
            np.stack([20.0 + 10 * np.sin(turn), 10 - 10 * np.cos(turn)], axis=1),
            np.stack([np.full(40, 10.0), np.arange(10.0, -30.0, -1.0)], axis=1),
        ]
    )
    path = FrenetPath(loop)
    crossing = np.array([[10.0, 0.0]])
    first = path.locate(crossing, near_arc_m=np.array([38.0])).arc_m[0]
    second = path.locate(crossing, near_arc_m=np.array([105.0])).arc_m[0]
    assert first == pytest.approx(40.0, abs=0.5)
    assert second > 90.0


def test_repeated_points_are_no_harm_and_a_single_one_is_refused() -> None:
    path = FrenetPath(np.array([[0.0, 0.0], [0.0, 0.0], [5.0, 0.0]]), np.array([5.0, 6.0, np.nan]))
    assert path.length_m == 5.0
    assert np.isinf(path.speed_limit_mps[-1])
    with pytest.raises(ValueError, match="two distinct points"):
        FrenetPath(np.zeros((3, 2)))
    with pytest.raises(ValueError, match="finite"):
        FrenetPath(np.array([[0.0, 0.0], [np.nan, 1.0]]))


def test_an_eased_corner_is_cut_by_a_car_that_turns_on_the_way() -> None:
    corner = FrenetPath(np.array([[-40.0, 0.0], [0.0, 0.0], [0.0, 40.0]]))
    turn = np.abs(np.diff(corner.eased.node_poses[:, 2]))
    assert np.abs(np.diff(corner.node_poses[:, 2])).max() > 2.0 * turn.max()
    assert turn.sum() == pytest.approx(math.pi / 2)
    cut = corner.eased.point_at(np.array([40.0]))[0]
    assert float(np.hypot(*cut)) < 1.2
    assert cut[0] < 0.0 < cut[1]
    # Away from the corner nothing changes, and arc lengths stay.
    assert corner.eased.point_at(np.array([20.0, 60.0])) == pytest.approx(
        corner.point_at(np.array([20.0, 60.0]))
    )
    assert corner.eased.eased is corner.eased


def test_a_path_that_is_done_with_goes_without_a_search_for_garbage() -> None:
    path = FrenetPath(np.array([[-40.0, 0.0], [0.0, 0.0], [0.0, 40.0]]))
    plain, eased = weakref.ref(path), weakref.ref(path.eased.eased)
    gc.disable()
    try:
        del path
        assert plain() is None
        assert eased() is None
    finally:
        gc.enable()


def test_an_eased_path_travels_to_other_processes() -> None:
    again = pickle.loads(pickle.dumps(CIRCLE.eased))
    assert again.eased is again
    assert again.node_poses == pytest.approx(CIRCLE.eased.node_poses)
    assert pickle.loads(pickle.dumps(CIRCLE)).node_poses == pytest.approx(CIRCLE.node_poses)


def test_the_bound_of_speeds_holds_between_nodes_and_grows_with_accelerations() -> None:
    bounds = {"lateral_accel_mps2": 2.0, "decel_mps2": 1.5, "accel_mps2": 1.0}
    square = CIRCLE.bounded_squares(**bounds)
    turn = np.abs(np.diff(CIRCLE.node_poses[:, 2]))
    assert (np.maximum(square[1:], square[:-1]) * turn).max() <= 2.0 + 1e-9
    assert np.diff(square).min() >= -2.0 * 1.5 - 1e-6
    assert np.diff(square).max() <= 2.0 * 1.0 + 1e-6
    twice = CIRCLE.bounded_squares(**{name: 2.0 * value for name, value in bounds.items()})
    assert twice == pytest.approx(2.0 * square)
