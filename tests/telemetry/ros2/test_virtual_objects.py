"""Road users that do not exist: told apart from real ones, put together, placed by the mapping."""

from __future__ import annotations

import math

import msgspec
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from foretwin.contracts.drive import RoadUser, RoadUsers
from foretwin.contracts.frames import GeoPoint, local_from_geo
from foretwin.telemetry.ros2.mapping import MappingError, parse_mapping
from foretwin.telemetry.ros2.virtual_objects import (
    PlacedObject,
    UnfitError,
    VirtualObjects,
)
from tests.telemetry.ros2.gateway_ground import FRAME

S = 10**9
OUT = """dialect = "ros2dds"
[[out]]
topic = "/foretwin/virtual_objects"
type = "autoware_perception_msgs/msg/PredictedObjects"
source = "virtual_objects"
"""
VIRTUAL = """[[virtual]]
id = "parked"
kind = "car"
lat_deg = 52.5
lon_deg = 13.4
"""


def user(name: str, *, virtual: bool = True, speed_mps: float = 0.0, lat: float = 52.5) -> RoadUser:
    return RoadUser(
        user_id=name,
        kind="car",
        position=GeoPoint(lat, 13.4),
        yaw_rad=0.0,
        speed_mps=speed_mps,
        length_m=4.0,
        width_m=2.0,
        virtual=virtual,
    )


def said(stamp_ns: int, *users: RoadUser) -> RoadUsers:
    return RoadUsers(stamp_ns=stamp_ns, users=users)


def xy_m(one: RoadUser) -> np.ndarray:
    return local_from_geo(FRAME, one.position.lat_deg, one.position.lon_deg)


def test_two_senders_do_not_undo_one_another() -> None:
    objects = VirtualObjects(at_most=8)
    objects.take(said(S, user("a", speed_mps=10.0)), now_ns=0)
    both = objects.take(said(S + S // 10, user("b")), now_ns=S // 10)
    assert [one.user_id for one in both.users] == ["a", "b"]
    # The first has driven on for a tenth of a second, east.
    assert xy_m(both.users[0]) == pytest.approx([1.0, 0.0], abs=1e-3)
    assert both.users[1] == user("b")
    alone = objects.take(said(2 * S, user("b")), now_ns=6 * S // 10 + 1)
    assert [one.user_id for one in alone.users] == ["b"]


@pytest.mark.parametrize(
    ("users", "why"),
    [
        ((user("a"), user("b", virtual=False)), "not marked as virtual"),
        ((user("a", lat=math.nan),), "not finite"),
        (tuple(user(str(k)) for k in range(9)), "too many"),
    ],
)
def test_what_must_not_go_out_is_refused_and_changes_nothing(
    users: tuple[RoadUser, ...], why: str
) -> None:
    objects = VirtualObjects(at_most=8)
    with pytest.raises(UnfitError, match=why):
        objects.take(said(S, *users), now_ns=0)
    assert objects.take(said(S, user("c")), now_ns=0).users == (user("c"),)


@pytest.mark.parametrize(
    ("changed", "fits"),
    [
        ({"speed_mps": 100.0}, True), ({"speed_mps": -100.0}, True), ({"speed_mps": 100.1}, False),
        ({"length_m": 0.01}, True), ({"length_m": 0.0}, False), ({"length_m": 49.9}, True),
        ({"length_m": 50.0}, False), ({"width_m": 0.0}, False), ({"width_m": 50.0}, False),
    ],
)  # fmt: skip
def test_a_virtual_road_user_is_of_some_vehicles_size_and_speed(
    changed: dict[str, float], fits: bool
) -> None:
    one = said(S, msgspec.structs.replace(user("a"), **changed))
    if fits:
        assert VirtualObjects(at_most=1).take(one, now_ns=0) == one
        return
    with pytest.raises(UnfitError, match="impossible size or speed"):
        VirtualObjects(at_most=1).take(one, now_ns=0)


@pytest.mark.parametrize(
    ("later_ns", "stamp_ns", "east_m"),
    [
        (S // 10, S + S // 10, 1.0),
        (-S // 10, S, 0.0),  # the list does not go back: this one is moved on to it
        (S - 1, 2 * S - 1, 10.0),
        (S, 2 * S, 0.0),  # told so long ago that nobody knows where it is now: as it was told
        (-S, 0, 0.0),  # the vehicle's clock is set anew
    ],
)
def test_all_are_told_as_they_are_at_one_stamp(later_ns: int, stamp_ns: int, east_m: float) -> None:
    objects = VirtualObjects(at_most=2)
    objects.take(said(S, user("a", speed_mps=10.0)), now_ns=0)
    both = objects.take(said(S + later_ns, user("b", speed_mps=10.0)), now_ns=S // 2)
    assert both.stamp_ns == stamp_ns
    assert xy_m(both.users[0])[0] == pytest.approx(east_m, abs=1e-3)
    moved_on_m = 1.0 if stamp_ns > S + later_ns else 0.0
    assert xy_m(both.users[1])[0] == pytest.approx(moved_on_m, abs=1e-3)


def test_who_sets_out_does_so_with_the_first_state_and_anew_where_the_clock_goes_back() -> None:
    placed = PlacedObject(
        user_id="p", kind="car", lat_deg=52.5, lon_deg=13.4, speed_mps=5.0, way_m=10.0
    )
    objects = VirtualObjects(at_most=1, placed=(placed,))
    assert objects.has_own
    assert not VirtualObjects(at_most=1).has_own
    stamps_ns = 5 * S, 5 * S + 1_234_567_890, 3 * S, 4 * S
    east_m = [float(xy_m(objects.own(stamp_ns).users[0])[0]) for stamp_ns in stamps_ns]
    assert east_m == pytest.approx([0.0, 6.173, 0.0, 5.0], abs=1e-3)


@pytest.mark.parametrize(
    ("line", "said"),
    [
        ("lat_deg = 89.9", None), ("lat_deg = 90.0", "degrees"), ("lon_deg = -180.0", None),
        ("lon_deg = 180.1", "degrees"), ("alt_m = inf", "finite"), ("yaw_deg = nan", "finite"),
        ("length_m = 50.0", "length_m 50.0: above 0 and below 50"),
        ("length_m = 50.1", "length_m 50.1: above 0"), ("speed_mps = 0.5", "way_m: how far"),
        ("width_m = 49.9", None),
        ("speed_mps = 50.0\nway_m = 1000.0", None),
        ("speed_mps = 50.1\nway_m = 1.0", "0 to 50"), ("speed_mps = -0.1\nway_m = 1.0", "0 to 50"),
        ("way_m = 1000.1", "0 to 1000"), ("way_m = -0.1", "0 to 1000"), ("way_m = 5.0", None),
        ("speed = 5.0", "unknown key 'speed'"),
    ],
)  # fmt: skip
def test_what_a_mapping_may_place(line: str, said: str | None) -> None:
    named = {word.split(" ", 1)[0] for word in line.split("\n")}
    kept = [one for one in VIRTUAL.splitlines() if one.split(" ", 1)[0] not in named]
    text = OUT + "\n".join([*kept, line])
    if said is None:
        assert parse_mapping(text, name="m.toml").placed
        return
    with pytest.raises(MappingError, match=said):
        parse_mapping(text, name="m.toml")


@given(
    st.floats(0.1, 50.0), st.floats(0.5, 1000.0), st.floats(-720.0, 720.0), st.floats(0.0, 3600.0)
)
def test_what_goes_to_and_fro_stays_on_its_way(
    speed_mps: float, way_m: float, yaw_deg: float, time_s: float
) -> None:
    placed = PlacedObject(
        user_id="p",
        kind="pedestrian",
        lat_deg=52.5,
        lon_deg=13.4,
        yaw_deg=yaw_deg,
        speed_mps=speed_mps,
        way_m=way_m,
    )
    placed.validate()
    one = placed.at(time_s)
    along = math.cos(math.radians(yaw_deg)), math.sin(math.radians(yaw_deg))
    forth_m, aside_m = xy_m(one) @ along, xy_m(one) @ (-along[1], along[0])
    assert -0.01 <= forth_m <= way_m + 0.01
    assert abs(aside_m) < 0.01 + 1e-3 * way_m
    turned = math.cos(one.yaw_rad - math.radians(yaw_deg))
    assert turned == pytest.approx(1.0 if speed_mps * time_s % (2 * way_m) <= way_m else -1.0)


def test_the_mapping_places_what_stands() -> None:
    (placed,) = parse_mapping(OUT + VIRTUAL, name="m.toml").placed
    objects = VirtualObjects(at_most=8, placed=(placed,))
    (one,) = objects.own(5 * S).users
    assert (one.user_id, one.virtual, one.speed_mps) == ("parked", True, 0.0)
    assert xy_m(one) == pytest.approx([0.0, 0.0], abs=1e-6)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (VIRTUAL, r"line 2: \[\[virtual\]\]: without an \[\[out\]\]"),
        (OUT + VIRTUAL + VIRTUAL, r"line 11: .*id 'parked' stands twice"),
        (OUT + VIRTUAL + "speed_mps = 2.0", "way_m"),
        (OUT + VIRTUAL + "width_m = 0.0", "width_m 0.0: above 0"),
        (OUT + VIRTUAL.replace('"car"', '"ufo"'), r"m\.toml: .*ufo"),
    ],
)
def test_errors_say_where_and_what_would_be_right(text: str, said: str) -> None:
    if not text.startswith("dialect"):
        text = 'dialect = "ros2dds"\n' + text
    with pytest.raises(MappingError, match=said):
        parse_mapping(text, name="m.toml")
