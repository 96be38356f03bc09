"""What a car was shown does not come back as something that it has seen."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from msgspec.structs import replace

from foretwin.contracts.drive import RoadUser, RoadUsers
from foretwin.contracts.frames import GeoPoint, LocalFrame
from foretwin.contracts.point_cloud import PointCloud
from foretwin.telemetry.ros2.injected import Injected
from foretwin.telemetry.ros2.virtual_objects import moved
from foretwin.telemetry.ros_messages import parts
from foretwin.telemetry.ros_messages.objects import (
    detected_from_users,
    predicted_from_users,
    users_from_detected,
    users_from_predicted,
)

S = 10**9
HERE = GeoPoint(52.5, 13.4)
MAP = LocalFrame(HERE)


def walker(**changed: Any) -> RoadUser:
    user = RoadUser(
        user_id="walker", kind="pedestrian", position=HERE, yaw_rad=math.pi / 2, speed_mps=1.4,
        length_m=0.5, width_m=0.6, virtual=True,
    )  # fmt: skip
    return replace(user, **changed)


def shown(*users: RoadUser, stamp_ns: int = 5 * S) -> Injected:
    injected = Injected()
    injected.note(RoadUsers(stamp_ns=stamp_ns, users=users))
    return injected


def test_it_is_known_by_its_uuid_wherever_it_is_seen():
    echo = users_from_predicted(
        predicted_from_users(RoadUsers(stamp_ns=6 * S, users=(moved(walker(), 20.0),)), MAP),
        MAP, stamp_ns=6 * S,
    )  # fmt: skip
    real = replace(walker(), user_id="0123456789abcdef0123456789abcdef", virtual=False)
    seen = replace(echo, users=(*echo.users, real))
    assert [one.user_id for one in echo.users] != ["walker"]
    assert shown(walker()).without(seen).users == (real,)
    assert Injected().without(seen) is seen


def test_in_a_list_without_ids_it_is_known_by_place_size_and_speed():
    def seen(user: RoadUser, stamp_ns: int) -> RoadUsers:
        ros = detected_from_users(RoadUsers(stamp_ns=stamp_ns, users=(user,)), MAP)
        return users_from_detected(ros, MAP, stamp_ns=parts.stamp_ns_of(ros.header.stamp))

    injected = shown(walker())
    half_a_second_on = moved(walker(), 0.7)
    assert injected.without(seen(half_a_second_on, 5 * S + S // 2)).users == ()
    for real in (
        moved(walker(), 1.3),  # elsewhere
        replace(half_a_second_on, length_m=0.52),
        replace(half_a_second_on, speed_mps=1.6),
    ):
        there = seen(real, 5 * S + S // 2)
        assert injected.without(there) is there
    long_gone = seen(moved(walker(), 1.4 * 3.0), 8 * S)
    assert injected.without(long_gone) is long_gone


@pytest.mark.parametrize(
    ("field", "least", "most"),
    [("length_m", 0.491, 0.509), ("width_m", 0.591, 0.609), ("speed_mps", 1.31, 1.49)],
)
def test_sizes_and_speeds_are_the_same_within_a_centimetre_and_a_tenth(
    field: str, least: float, most: float
):
    def is_left(value: float) -> bool:
        user = replace(walker(), user_id="7", **{field: value})
        return bool(shown(walker()).without(RoadUsers(stamp_ns=5 * S, users=(user,))).users)

    assert not is_left(least)
    assert not is_left(most)
    assert is_left(2.0 * least - getattr(walker(), field))
    assert is_left(2.0 * most - getattr(walker(), field))


def cloud(stamp_ns: int, sensor: str = "top") -> PointCloud:
    return PointCloud(stamp_ns=stamp_ns, points=np.zeros((0, 6), np.float32), sensor=sensor)


@given(way_rad=st.floats(-math.pi, math.pi), away_m=st.floats(0.0, 1.5), after_s=st.floats(-3, 3))
def test_places_are_the_same_within_half_a_metre_and_two_seconds(
    way_rad: float, away_m: float, after_s: float
):
    """Of where it would be by then."""
    assume(abs(away_m - 0.5) > 1e-3)
    assume(abs(abs(after_s) - 2.0) > 1e-3)
    then = moved(walker(), 1.4 * after_s)
    there = replace(moved(replace(then, yaw_rad=way_rad), away_m), yaw_rad=0.0, user_id="7")
    seen = RoadUsers(stamp_ns=5 * S + round(after_s * S), users=(there,))
    is_it = away_m < 0.5 and abs(after_s) < 2.0
    assert shown(walker()).without(seen).users == (() if is_it else (there,))


@given(
    yaw_rad=st.floats(-math.pi, math.pi),
    ahead_m=st.floats(-4.0, 4.0),
    aside_m=st.floats(-4.0, 4.0),
)
def test_a_sensor_sees_it_within_half_a_metre_of_its_outline(
    yaw_rad: float, ahead_m: float, aside_m: float
):
    assume(abs(abs(ahead_m) - 2.5) > 1e-3)
    assume(abs(abs(aside_m) - 1.5) > 1e-3)
    wide = walker(length_m=4.0, width_m=2.0, speed_mps=0.0, yaw_rad=yaw_rad)
    injected = Injected()
    injected.note_measured(cloud(5 * S), RoadUsers(stamp_ns=5 * S, users=(wide,)))
    aside = moved(replace(wide, yaw_rad=yaw_rad + math.pi / 2), aside_m)
    there = moved(replace(aside, yaw_rad=yaw_rad, user_id="7", width_m=1.1), ahead_m)
    is_it = abs(ahead_m) < 2.5 and abs(aside_m) < 1.5
    seen = RoadUsers(stamp_ns=5 * S, users=(there,))
    assert injected.without(seen).users == (() if is_it else (there,))


def test_whom_tracking_gives_an_id_of_its_own_is_known_as_well():
    """Lists of detected objects go out without ids, and come back tracked."""

    def seen(user: RoadUser) -> RoadUsers:
        return RoadUsers(stamp_ns=5 * S, users=(user,))

    tracked = replace(walker(), user_id="0123456789abcdef0123456789abcdef", virtual=False)
    nameless = Injected()
    nameless.note(RoadUsers(stamp_ns=5 * S, users=(walker(),)), how="nameless")
    assert nameless.without(seen(tracked)).users == ()
    beside = seen(moved(replace(tracked, yaw_rad=0.0), 0.6))
    assert nameless.without(beside) is beside
    # Later shown with its id as well, which one perception keeps, and another not.
    nameless.note(RoadUsers(stamp_ns=5 * S, users=(walker(),)))
    assert nameless.without(seen(tracked)).users == ()
    assert shown(walker()).without(seen(tracked)).users == (tracked,)


def test_a_real_one_that_is_merged_into_the_list_stays_real():
    real = walker(virtual=False, user_id="0123456789abcdef0123456789abcdef")
    seen = RoadUsers(stamp_ns=5 * S, users=(real,))
    assert shown(real).without(seen) is seen


def test_the_newest_thousands_are_remembered():
    injected = shown(*(walker(user_id=f"w{number}") for number in range(5000)))
    ids = [bytes(injected_uuid(number)).hex() for number in (0, 903, 904, 4999)]
    seen = [RoadUsers(stamp_ns=9 * S, users=(walker(user_id=one),)) for one in ids]
    left = [len(injected.without(one).users) for one in seen]
    assert left == [1, 1, 0, 0], "4,096 of them"


def test_the_newest_clouds_are_remembered():
    injected = Injected()
    for stamp_ns in range(1, 101):
        injected.note_measured(cloud(stamp_ns), RoadUsers(stamp_ns=stamp_ns, users=()))
    shown_ones = [injected.is_shown_cloud(cloud(n)) for n in (36, 37, 100, 101)]
    assert shown_ones == [False, True, True, False]


def test_a_cloud_of_another_lidar_with_the_same_stamp_was_not_sent():
    """Lidars that one clock fires, as those of simulators all are, say the same stamps."""
    injected = Injected()
    injected.note_measured(cloud(5 * S, "left"), RoadUsers(stamp_ns=5 * S, users=()))
    assert injected.is_shown_cloud(cloud(5 * S, "left"))
    assert not injected.is_shown_cloud(cloud(5 * S, "right"))


def test_one_that_is_shown_again_and_again_is_not_forgotten_for_new_ones():
    injected = shown(walker())
    for begin in range(0, 4500, 500):
        others = (walker(user_id=f"w{begin + number}") for number in range(500))
        injected.note(RoadUsers(stamp_ns=6 * S, users=(walker(), *others)))
    echo = predicted_from_users(RoadUsers(stamp_ns=6 * S, users=(walker(),)), MAP)
    assert injected.without(users_from_predicted(echo, MAP, stamp_ns=6 * S)).users == ()


def injected_uuid(number: int) -> Any:
    from foretwin.telemetry.ros_messages.shapes import uuid_from

    return uuid_from(walker(user_id=f"w{number}")).uuid
