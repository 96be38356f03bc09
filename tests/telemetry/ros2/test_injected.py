"""What a car was shown does not come back as something that it has seen."""

from __future__ import annotations

import math
from typing import Any

from msgspec.structs import replace

from foretwin.contracts.drive import RoadUser, RoadUsers
from foretwin.contracts.frames import GeoPoint, LocalFrame
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
    ids = [bytes(injected_uuid(number)).hex() for number in (0, 4999)]
    first, last = (RoadUsers(stamp_ns=9 * S, users=(walker(user_id=one),)) for one in ids)
    assert injected.without(first) is first
    assert injected.without(last).users == ()


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


def test_whom_a_sensor_was_shown_is_known_within_its_outline_and_nowhere_else():
    injected = Injected()
    wide = walker(length_m=4.0, width_m=2.0, speed_mps=0.0)
    injected.note_measured(5 * S, RoadUsers(stamp_ns=5 * S, users=(wide,)))

    def is_left(ahead_m: float, aside_m: float) -> bool:
        there = moved(replace(wide, yaw_rad=wide.yaw_rad + math.pi / 2), aside_m)
        there = moved(replace(there, yaw_rad=wide.yaw_rad, user_id="7", width_m=1.1), ahead_m)
        return bool(injected.without(RoadUsers(stamp_ns=5 * S, users=(there,))).users)

    assert not is_left(0.0, 0.0)
    assert not is_left(0.5, -0.9)
    assert not is_left(-1.9, 0.4)
    assert is_left(0.0, 2.0)
    assert is_left(3.0, 0.0)
