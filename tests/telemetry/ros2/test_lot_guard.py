"""A car may be shown what is not there well within its fence, while it is heard of."""

from __future__ import annotations

import math
from typing import Any

import msgspec
import pytest
from hypothesis import given
from hypothesis import strategies as st

from foretwin.contracts.anchor import Anchor, AnchorPose
from foretwin.contracts.drive import VehicleState
from foretwin.contracts.frames import GeoPoint, LocalFrame, geo_pose
from foretwin.contracts.setup import BusSetup, Ros2Setup
from foretwin.sim_worker.vehicle.parameters import load_vehicle
from foretwin.telemetry.ros2.__main__ import lot_guard
from foretwin.telemetry.ros2.lot_guard import LotGuard, margin_m

S, MS = 10**9, 10**6
FRAME = LocalFrame(GeoPoint(52.4739, 13.395))
CORNERS_M = ((-100.0, -50.0), (100.0, -50.0), (100.0, 50.0), (-100.0, 50.0))


def degrees(x_m: float, y_m: float) -> tuple[float, float]:
    at = geo_pose(FRAME, x_m, y_m, 0.0).position
    return at.lat_deg, at.lon_deg


def guard(reach_m: float = 4.0) -> LotGuard:
    return LotGuard([degrees(*one) for one in CORNERS_M], frame=FRAME, reach_m=reach_m)


def state(x_m: float, y_m: float = 0.0, speed_mps: float = 0.0, **changed: Any) -> VehicleState:
    told = VehicleState(
        vehicle_id="ego", stamp_ns=S, position=GeoPoint(*degrees(x_m, y_m)), yaw_rad=0.0,
        speed_mps=speed_mps, yaw_rate_radps=0.0, accel_mps2=0.0,
    )  # fmt: skip
    return msgspec.structs.replace(told, **changed)


def trouble(told: VehicleState, *, after_ns: int = 0, silent_ns: int = 0) -> str | None:
    """Return what is wrong, in words."""
    one = guard()
    one.take_state(told, now_ns=S)
    now_ns = S + after_ns
    found = one.trouble(now_ns, heard_ns=now_ns - silent_ns)
    return found and found.text


def test_the_margin_is_the_way_of_reacting_and_of_braking():
    assert margin_m(0.0) == 0.0
    assert margin_m(8.0) == margin_m(-8.0) == pytest.approx(8.0 * 2.5 + 64.0 / (2.0 * 3.4))
    assert margin_m(-8.0) == margin_m(8.0)


def test_in_the_middle_all_is_well():
    assert trouble(state(0.0, speed_mps=8.0)) is None


@given(x_m=st.floats(-150.0, 150.0), y_m=st.floats(-90.0, 90.0), speed_mps=st.floats(-15.0, 15.0))
def test_the_body_and_the_margin_must_fit_between_the_car_and_the_fence(x_m, y_m, speed_mps):
    left_m = min(100.0 - abs(x_m), 50.0 - abs(y_m)) - 4.0 - margin_m(speed_mps)
    if abs(left_m) > 0.01:
        assert (trouble(state(x_m, y_m, speed_mps)) is None) == (left_m > 0.0)


def test_what_is_wrong_is_told():
    assert trouble(state(101.0)) == "the car is outside its fence"
    assert trouble(state(70.0, speed_mps=8.0)) == (
        "the fence is 26.0 m off, 29.4 m are needed at this speed"
    )
    assert trouble(state(0.0, stale=("gnss",))) == "the car's positions are overdue"
    assert trouble(state(0.0, stale=("imu",))) is None
    assert trouble(state(0.0, speed_mps=math.nan)) is not None


def test_a_car_that_was_never_heard_of_is_shown_nothing():
    assert guard().trouble(S, heard_ns=S) is not None


def test_a_position_that_the_estimate_does_not_follow_is_trouble():
    one = guard(reach_m=4.0)
    one.take_state(state(0.0), now_ns=S)
    for apart_m, fine in ((8.9, True), (9.1, False), (300.0, False)):
        fix = GeoPoint(*degrees(0.0, apart_m))
        assert (one.trouble(S, heard_ns=S, fix=fix) is None) == fine
    assert one.trouble(S, heard_ns=S, fix=GeoPoint(math.nan, 13.4)) is not None


def test_what_is_old_says_nothing():
    inside = state(0.0)
    assert trouble(inside, after_ns=150 * MS) is None
    assert "no new state" in str(trouble(inside, after_ns=151 * MS))
    assert trouble(inside, silent_ns=150 * MS) is None
    assert "nothing heard" in str(trouble(inside, silent_ns=151 * MS))


def test_a_state_that_is_said_again_and_again_says_nothing_new():
    one = guard()
    for after_ms in range(0, 200, 20):
        one.take_state(state(0.0), now_ns=S + after_ms * MS)
    assert one.trouble(S + 180 * MS, heard_ns=S + 180 * MS) is not None


@pytest.mark.parametrize(("scale", "reason"), [(10.0, None), (1.0, "near the fence")])
def test_a_small_car_is_small_on_its_lot(scale: float, reason: str | None) -> None:
    """Its parameters are those of the World, where a lot of 20 m by 8 m is ten times as large."""
    pose = AnchorPose(lat_deg=FRAME.origin.lat_deg, lon_deg=FRAME.origin.lon_deg, yaw_deg=0.0)
    corners = ((-10.0, -4.0), (10.0, -4.0), (10.0, 4.0), (-10.0, 4.0))
    setup = Ros2Setup(
        run_id="r", process_id="ros2", bus=BusSetup(endpoint="tcp/127.0.0.1:1"), log_file="l",
        vehicle_id="ego", mapping="", mapping_name="m", drive_frame=FRAME,
        anchor=Anchor(lot=pose, world=pose, scale=scale),
        fence=tuple(degrees(*one) for one in corners), vehicle=load_vehicle("f1tenth"),
    )  # fmt: skip
    watch = lot_guard(setup)
    assert watch is not None
    watch.take_state(state(0.0, speed_mps=0.5), now_ns=S)
    found = watch.trouble(S, heard_ns=S)
    assert (found and found.reason) == reason
    if scale == 10.0:  # half a metre there is five in the World
        near, far = (
            watch.trouble(S, heard_ns=S, fix=GeoPoint(*degrees(x, 0.0))) for x in (0.8, 1.2)
        )
        assert near is None
        assert far is not None
        assert far.reason == "position apart"
