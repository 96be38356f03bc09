"""What others are told of a vehicle holds to a metre, and they are told for how long."""

from __future__ import annotations

import msgspec
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from foretwin.contracts.drive import VehicleState
from foretwin.contracts.frames import GeoPoint, LocalFrame, local_from_geo
from foretwin.geometry.constant_turn import constant_turn_rate
from foretwin.orchestrator.other_vehicles.dead_reckoning import MOST_ASTRAY_M, reckoned_for_s
from foretwin.orchestrator.other_vehicles.surroundings import Measured, surroundings
from foretwin.sim_worker.vehicle.parameters import GRAVITY_MPS2, load_vehicle
from foretwin.sim_worker.vehicle.reference_points import box_centre_from_base_m

CAR = load_vehicle(None)
ORIGIN = GeoPoint(52.5, 13.4)
STATE = VehicleState(
    vehicle_id="ego", stamp_ns=10_000_000_000, position=ORIGIN, yaw_rad=0.0, speed_mps=10.0,
    yaw_rate_radps=0.0, accel_mps2=0.0,
)  # fmt: skip


def test_they_are_reckoned_to_one_stamp_by_the_clock_of_who_is_told() -> None:
    told = surroundings([Measured(STATE, CAR)], stamp_ns=STATE.stamp_ns + 10**8, later_ns=-(10**9))
    (user,) = told.users.users
    assert told.users.stamp_ns == STATE.stamp_ns + 10**8 + 10**9
    assert told.known_for_s == pytest.approx((reckoned_for_s(CAR) - 0.1,))
    x_m, _ = local_from_geo(LocalFrame(ORIGIN), user.position.lat_deg, user.position.lon_deg)
    assert x_m == pytest.approx(1.0 + box_centre_from_base_m(CAR), abs=1e-6)
    assert user.virtual


def test_who_is_not_known_to_a_metre_any_more_is_left_out() -> None:
    late_ns = STATE.stamp_ns + round(1.01e9 * reckoned_for_s(CAR))
    told = surroundings([Measured(STATE, CAR)], stamp_ns=late_ns, later_ns=0)
    assert (told.users.users, told.known_for_s) == ((), ())


@given(
    along=st.floats(-1.0, 1.0), turns=st.floats(-1.0, 1.0), speed_mps=st.floats(5.0, 30.0),
    share=st.floats(0.0, 1.0),
)  # fmt: skip
def test_whatever_its_driver_does_it_is_within_a_metre_of_straight_on(
    along: float, turns: float, speed_mps: float, share: float
) -> None:
    """Of a car that drove evenly as it was measured; tyres hold no more than µ g in sum."""
    state = msgspec.structs.replace(STATE, speed_mps=speed_mps)
    told = surroundings([Measured(state, CAR)], stamp_ns=state.stamp_ns, later_ns=0)
    grip = CAR.friction.value * GRAVITY_MPS2 / max(1.0, np.hypot(along, turns))
    time_s = share * told.known_for_s[0]
    ((x_m, y_m, _),) = constant_turn_rate(
        np.zeros(3), speed_mps=speed_mps, accel_mps2=min(along * grip, 0.0),
        yaw_rate_radps=turns * grip / speed_mps, time_s=np.array([time_s]),
    )  # fmt: skip
    (user,) = told.users.users
    straight_m = user.speed_mps * time_s
    assert np.hypot(x_m - straight_m, y_m) <= MOST_ASTRAY_M + 1e-9
