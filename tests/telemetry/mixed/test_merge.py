"""Real and virtual road users as one surrounding: real ones win, hidden ones are not told."""

from __future__ import annotations

import math

import msgspec
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from foretwin.contracts.drive import RoadUser, RoadUserKind, VehicleState
from foretwin.contracts.frames import GeoPoint, LocalFrame, geo_pose
from foretwin.telemetry.mixed.merge import Merged, MergeRules, merge, rectangles_of, viewpoint

FRAME = LocalFrame(GeoPoint(52.5, 13.4))
RULES = MergeRules()
SIZE: dict[RoadUserKind, tuple[float, float]] = {
    "van": (5.0, 2.0), "car": (4.5, 1.8), "pedestrian": (0.5, 0.6), "lorry": (12.0, 2.5),
}  # fmt: skip


def user(
    name: str, kind: RoadUserKind, x_m: float, y_m: float, yaw_rad: float = 0.0, *, virtual: bool
) -> RoadUser:
    at = geo_pose(FRAME, x_m, y_m, yaw_rad)
    length_m, width_m = SIZE.get(kind, (2.0, 2.0))
    return RoadUser(
        user_id=name, kind=kind, position=at.position, yaw_rad=at.yaw_rad, speed_mps=0.0,
        length_m=length_m, width_m=width_m, virtual=virtual,
    )  # fmt: skip


def car(x_m: float = 0.0, y_m: float = 0.0, yaw_rad: float = 0.0) -> VehicleState:
    at = geo_pose(FRAME, x_m, y_m, yaw_rad)
    return VehicleState(
        vehicle_id="ego", stamp_ns=1, position=at.position, yaw_rad=at.yaw_rad, speed_mps=0.0,
        yaw_rate_radps=0.0, accel_mps2=0.0,
    )  # fmt: skip


def merged(real: list[RoadUser], virtual: list[RoadUser], rules: MergeRules = RULES) -> Merged:
    return merge(real, virtual, viewpoint(car(), FRAME, rules, stamp_ns=1), rules, FRAME)


VAN = user("van", "van", 12.0, 0.0, math.pi / 2, virtual=False)
GHOST_VAN = user("ghost", "van", 12.0, 0.0, math.pi / 2, virtual=True)
WALKER = user("walker", "pedestrian", 16.0, 0.0, virtual=True)


def test_a_virtual_walker_behind_a_real_van_is_not_reported() -> None:
    assert merged([VAN], [WALKER]) == Merged((), frozenset(), coincide=0, not_seen=1)


def test_nor_is_one_behind_a_virtual_van() -> None:
    assert merged([], [GHOST_VAN, WALKER]).virtual == (GHOST_VAN,)


def test_one_that_comes_out_from_behind_it_is_reported() -> None:
    out = user("walker", "pedestrian", 16.0, 4.5, virtual=True)
    assert merged([VAN], [out]) == Merged((out,), frozenset(), coincide=0, not_seen=0)


def test_a_virtual_body_hides_no_real_one_unless_that_is_asked_for() -> None:
    real = user("real", "pedestrian", 16.0, 0.0, virtual=False)
    far = user("far", "pedestrian", 500.0, 300.0, virtual=False)
    assert merged([far, real], [GHOST_VAN]).hidden_real == frozenset()
    hiding = msgspec.structs.replace(RULES, hide_real=True, field_of_view_deg=90.0)
    assert merged([far, real], [GHOST_VAN], hiding).hidden_real == {1}


def test_real_bodies_hide_no_real_ones() -> None:
    real = user("real", "pedestrian", 16.0, 0.0, virtual=False)
    hiding = msgspec.structs.replace(RULES, hide_real=True)
    elsewhere = user("elsewhere", "car", -20.0, 0.0, virtual=True)
    assert merged([VAN, real], [elsewhere], hiding).hidden_real == frozenset()


def test_a_virtual_car_where_a_real_one_is_is_that_one() -> None:
    twin = user("twin", "car", 12.3, 0.4, math.pi / 2, virtual=True)
    assert merged([VAN], [twin]) == Merged((), frozenset(), coincide=1, not_seen=0)


@pytest.mark.parametrize(
    ("kind", "x_m", "same"),
    [("car", 13.4, True), ("car", 13.6, False), ("unknown", 12.0, False), ("lorry", 12.0, False)],
)
def test_one_is_another_by_place_and_size(kind: RoadUserKind, x_m: float, same: bool) -> None:
    """Half a metre beyond the outline, which is 1 m from the middle; 2 m by 2 m, 12 m by 2.5 m."""
    other = user("other", kind, x_m, 0.0, math.pi / 2, virtual=True)
    assert merged([VAN], [other]).coincide == same


def test_a_walker_is_no_bicycle_but_what_is_unknown_may_be_either() -> None:
    real = user("real", "pedestrian", 10.0, 0.0, virtual=False)
    for kind, same in (("bicycle", False), ("unknown", True), ("pedestrian", True)):
        other = msgspec.structs.replace(real, user_id="v", kind=kind, virtual=True)
        assert merged([real], [other]).coincide == same


def test_one_real_one_is_one_virtual_one_at_most_the_nearest() -> None:
    near = user("near", "pedestrian", 10.0, 5.1, virtual=True)
    next_to_it = user("next", "pedestrian", 10.0, 5.7, virtual=True)
    real = user("real", "pedestrian", 10.0, 5.0, virtual=False)
    assert merged([real], [next_to_it, near]).virtual == (next_to_it,)


def test_what_lies_beyond_range_or_field_of_view_is_not_reported() -> None:
    behind, far = (
        user("behind", "car", -12.0, 3.0, virtual=True),
        user("far", "car", 90.0, 3.0, virtual=True),
    )
    assert merged([], [behind, far]).virtual == (behind,)
    ahead = msgspec.structs.replace(RULES, field_of_view_deg=120.0, range_m=100.0)
    assert merged([], [behind, far], ahead).virtual == (far,)


def test_the_sensor_sees_from_its_place_on_the_car() -> None:
    rules = msgspec.structs.replace(RULES, sensor_m=(2.0, 1.0))
    view = viewpoint(car(10.0, 5.0, math.pi / 2), FRAME, rules, stamp_ns=1)
    assert (view.x_m, view.y_m) == (pytest.approx(9.0), pytest.approx(7.0))
    assert (view.yaw_rad, view.range_m) == (pytest.approx(math.pi / 2), 80.0)


def test_the_car_has_gone_on_by_the_stamp_of_what_it_sees() -> None:
    moving = msgspec.structs.replace(car(), speed_mps=10.0, yaw_rate_radps=0.5, stamp_ns=10**9)
    view = viewpoint(moving, FRAME, RULES, stamp_ns=1_200_000_000)
    assert (view.x_m, view.y_m) == (pytest.approx(2.0, abs=0.02), pytest.approx(0.2, abs=0.02))
    assert view.yaw_rad == pytest.approx(0.1)


@given(
    places=st.lists(
        st.tuples(
            st.sampled_from(sorted(SIZE)), st.floats(-60.0, 60.0), st.floats(-60.0, 60.0),
            st.floats(-3.0, 3.0), st.booleans(),
        ),
        max_size=12,
    )
)  # fmt: skip
def test_every_virtual_one_is_reported_is_real_or_is_not_seen(places: list) -> None:  # type: ignore[type-arg]
    users = [user(str(i), k, x, y, yaw, virtual=v) for i, (k, x, y, yaw, v) in enumerate(places)]
    real = [one for one in users if not one.virtual]
    virtual = [one for one in users if one.virtual]
    found = merged(real, virtual)
    assert len(found.virtual) + found.coincide + found.not_seen == len(virtual)
    assert found.hidden_real == frozenset()
    # Nobody is reported within a real one that is like him.
    for one in found.virtual:
        for other in real:
            away = rectangles_of([one], FRAME).centre_m - rectangles_of([other], FRAME).centre_m
            twice = sum(v.kind == other.kind for v in virtual) > 1
            assert one.kind != other.kind or twice or np.hypot(*away[0]) > 0.3


@pytest.mark.parametrize(
    "wrong",
    [
        {"range_m": 0.0}, {"range_m": math.nan}, {"field_of_view_deg": 361.0},
        {"sensor_m": (0.0, 21.0)}, {"least_seen": 0.0}, {"speed_std_mps": -1.0},
        {"yaw_std_rad": math.nan},
    ],
)  # fmt: skip
def test_rules_that_cannot_be_are_named(wrong: dict) -> None:  # type: ignore[type-arg]
    with pytest.raises(ValueError, match=next(iter(wrong))):
        msgspec.structs.replace(RULES, **wrong).validate()
