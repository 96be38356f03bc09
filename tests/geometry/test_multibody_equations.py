from __future__ import annotations

from typing import Any

import numpy as np
from vehiclemodels.init_mb import init_mb
from vehiclemodels.parameters_vehicle2 import parameters_vehicle2
from vehiclemodels.vehicle_dynamics_mb import vehicle_dynamics_mb

from foretwin.contracts.arrays import Array
from foretwin.geometry.multibody_equations import BODY, FIRST_WHEEL, STATES, TYRE, slope
from foretwin.sim_worker.engines.multibody import begin

MODEL: Any = parameters_vehicle2()
BODY_OF_320I = tuple(float(getattr(MODEL, name)) for name in BODY)
TYRE_OF_320I = tuple(float(getattr(MODEL.tire, name)) for name in TYRE)
SWAY = np.array(
    [0.0] * 6 + [0.02] * 4 + [0.1, 0.01, 0.1] + [0.02, 0.1, 0.1, 0.003, 0.1] * 2 + [1.0] * 4
    + [0.01] * 2
)  # fmt: skip
"""How far a state may be from rest, column by column."""


def change(
    state: Array, *, rate: float = 0.0, accel: float = 0.0, pull: float = 0.0, linkage: float = 0.0
) -> Array:
    out = np.empty(STATES)
    given = rate, max(accel, 0.0), max(-accel, 0.0), pull, 1.0, 1.0, 1.0, linkage
    slope(state, *given, BODY_OF_320I, TYRE_OF_320I, out)
    return out


def test_they_are_those_of_the_authors_program() -> None:
    rng = np.random.default_rng(1)
    for _ in range(100):
        core = [0.0, 0.0, *rng.uniform([-0.2, 2.0, -3.0, -0.5, -0.05], [0.2, 40.0, 3.0, 0.5, 0.05])]
        state = np.array(init_mb(core, MODEL)) + SWAY * rng.normal(size=STATES)
        # Within what the authors allow, so that their limits, which foretwin does not have, rest.
        rate, accel = rng.uniform(-0.3, 0.3), rng.uniform(-6.0, 2.0)
        theirs = np.array(vehicle_dynamics_mb(state.tolist(), [rate, accel], MODEL))
        ours = change(state.copy(), rate=rate, accel=accel)
        np.testing.assert_allclose(ours, theirs, rtol=1e-9, atol=1e-9)


def test_a_state_at_rest_is_theirs_as_well() -> None:
    ours = np.empty(STATES)
    begin(ours, 3.0, 4.0, 0.5, 12.0 * np.cos(0.03), 12.0 * np.sin(0.03), 0.2, 0.1, BODY_OF_320I)
    np.testing.assert_allclose(ours, init_mb([3.0, 4.0, 0.1, 12.0, 0.5, 0.2, 0.03], MODEL))


def test_a_locked_wheel_does_not_turn_back_and_a_pull_slows_the_body_alone() -> None:
    state = np.array(init_mb([0.0, 0.0, 0.0, 10.0, 0.0, 0.0, 0.0], MODEL), dtype=float)
    state[FIRST_WHEEL] = -1.0
    assert change(state, accel=-8.0)[FIRST_WHEEL] == state[FIRST_WHEEL] == 0.0
    pulled = change(state.copy(), pull=0.5) - change(state.copy())
    assert pulled[3] == -0.5
    assert np.count_nonzero(pulled) == 1


def test_a_linkage_turns_the_front_wheels_onto_one_circle() -> None:
    """There all wheels roll and no tyre pushes, but for what a tyre pulls aside by itself."""
    for steer in (0.0, 0.3, -0.4):
        bend = np.tan(steer) / (MODEL.a + MODEL.b)
        state = np.empty(STATES)
        speed = 3.0
        begin(
            state, 0.0, 0.0, 0.0, speed, MODEL.b * speed * bend, speed * bend, steer, BODY_OF_320I
        )
        state[6:10] = 0.0
        wide = 0.5 * np.array([MODEL.T_f, -MODEL.T_f, MODEL.T_r, -MODEL.T_r]) * bend
        ahead = np.array([1.0, 1.0, 0.0, 0.0]) * (MODEL.a + MODEL.b) * bend
        state[FIRST_WHEEL:27] = speed * np.hypot(1.0 + wide, ahead) / MODEL.R_w
        alike, linked = (change(state.copy(), linkage=one) for one in (0.0, 1.0))
        assert abs(linked[5]) < 0.03
        assert abs(linked[5]) <= 0.08 * abs(alike[5])
