"""Red lights: where a car stops, when it goes on, and that nothing else changes."""

from __future__ import annotations

import numpy as np
import pytest

from foretwin.sim_worker.planners.pure_pursuit_idm import PurePursuitIdm
from foretwin.sim_worker.vehicle.parameters import load_vehicle
from tests.sim_worker.planners.driven import at_rest_on, drive, straight, view_of

VEHICLE = load_vehicle()


@pytest.mark.parametrize("speed", [4.0, 8.0, 14.0])
def test_it_stops_before_the_line_and_goes_on_when_it_may(speed: float) -> None:
    path = straight()
    red = drive(
        PurePursuitIdm(), path, at_rest_on(path, 0.0, speed), vehicle=VEHICLE, seconds=30.0,
        target_mps=speed, red_arc_m=70.0, red_until_s=22.0,
    )  # fmt: skip
    waiting = red.front_m[0, round(21.9 / 0.05)]
    assert 67.5 < waiting < 70.0
    assert abs(red.states[0, round(21.9 / 0.05), 3]) < 0.05
    assert red.states[0, :, 7].min() > -4.5
    assert red.front_m[0, -1] > 71.0


def test_a_line_that_turns_red_too_near_to_stop_is_passed() -> None:
    path = straight()
    states = at_rest_on(path, 0.0, 14.0, count=2)
    front = 14.0 + VEHICLE.length_m.value - VEHICLE.rear_overhang_m.value
    near = view_of(path, states, VEHICLE, target_mps=14.0, stop_arc_m=np.array([front, np.inf]))
    accel = PurePursuitIdm().plan(near).accel_mps2
    assert accel[0] == accel[1]


def test_without_lights_nothing_changes_to_the_last_bit() -> None:
    path = straight()
    states = at_rest_on(path, 0.0, 9.0, count=5)
    states[:, 1] = np.linspace(-1.0, 1.0, 5)
    gaps = np.array([3.0, 10.0, 30.0, 100.0, np.inf])
    view = view_of(path, states, VEHICLE, lead_gap_m=gaps)
    plain = PurePursuitIdm().plan(view)
    lit = PurePursuitIdm().plan(view._replace(stop_arc_m=np.full(5, np.inf)))
    assert plain.accel_mps2.tobytes() == lit.accel_mps2.tobytes()
    assert plain.tire_angle_rad.tobytes() == lit.tire_angle_rad.tobytes()
