"""Which of the detected road users futures meet."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from foretwin.contracts.drive import RoadUser, RoadUsers, VehicleState
from foretwin.contracts.frames import GeoPoint, LocalFrame, geo_from_local, local_pose
from foretwin.orchestrator.rounds.seen_users import WITHIN_M, near_car

FRAME = LocalFrame(GeoPoint(52.5, 13.4))
CAR = VehicleState(
    vehicle_id="ego", stamp_ns=1_000, position=FRAME.origin, yaw_rad=0.0, speed_mps=10.0,
    yaw_rate_radps=0.0, accel_mps2=0.0,
)  # fmt: skip


def user(name: str, east_m: float, north_m: float = 0.0) -> RoadUser:
    lat, lon = geo_from_local(FRAME, np.array([east_m, north_m])).tolist()
    return RoadUser(
        user_id=name, kind="car", position=GeoPoint(lat, lon), yaw_rad=0.0, speed_mps=3.0,
        length_m=4.0, width_m=1.8,
    )  # fmt: skip


def seen(*users: RoadUser, stamp_ns: int = 1_000) -> RoadUsers:
    return RoadUsers(stamp_ns=stamp_ns, users=users)


def names(users: RoadUsers | None) -> list[str]:
    return [one.user_id for one in near_car(users, CAR, FRAME)]


def test_those_near_the_car_at_about_its_time_are_met() -> None:
    near, far = user("near", 30.0), user("far", WITHIN_M + 1.0)

    assert WITHIN_M == 120.0
    assert names(seen(near, user("edge", WITHIN_M - 1.0), far)) == ["near", "edge"]
    assert names(seen()) == names(None) == []
    for stamp_ns, heard in ((500_001_000, ["near"]), (-499_999_000, ["near"]), (500_001_001, [])):
        assert names(seen(near, stamp_ns=stamp_ns)) == heard


def test_who_is_met_is_as_it_was_seen_but_in_the_worlds_frame() -> None:
    world = LocalFrame(GeoPoint(52.51, 13.45))
    walker = RoadUser(
        user_id="7", kind="pedestrian", position=GeoPoint(52.5001, 13.4002), yaw_rad=0.7,
        speed_mps=1.5, length_m=0.5, width_m=0.6,
    )  # fmt: skip
    (found,) = near_car(seen(walker), CAR, world)
    at = local_pose(world, walker.position, 0.7)

    assert (found.x_m, found.y_m, found.yaw_rad) == pytest.approx(at)
    assert (found.user_id, found.kind) == ("7", "pedestrian")
    assert (found.speed_mps, found.length_m, found.width_m) == (1.5, 0.5, 0.6)


def test_nobody_is_there_twice() -> None:
    (found,) = near_car(seen(user("7", 30.0), user("7", 31.0)), CAR, FRAME)

    assert abs(found.x_m - 31.0) < 1e-6


@given(st.lists(st.tuples(st.floats(-100, 100), st.floats(-60, 60)), max_size=80))
def test_of_a_crowd_the_nearest_are_met_in_their_order(
    places: list[tuple[float, float]],
) -> None:
    users = [user(str(number), *place) for number, place in enumerate(places)]
    found = near_car(seen(*users), CAR, FRAME)
    away_m = {str(number): float(np.hypot(*place)) for number, place in enumerate(places)}

    assert len(found) == min(len(places), 16)
    kept = [one.user_id for one in found]
    assert kept == sorted(kept, key=int)
    left_m = [away_m[name] for name in away_m.keys() - set(kept)]
    assert not left_m or max(away_m[name] for name in kept) <= min(left_m) + 1e-6
