"""Where a vehicle is by now that was measured a moment ago, and how far astray that may be."""

from __future__ import annotations

import math

import msgspec
import numpy as np

from foretwin.contracts.drive import VehicleState
from foretwin.contracts.frames import LocalFrame, geo_pose, wrap_angle
from foretwin.contracts.vehicle import VehicleParameters
from foretwin.geometry.constant_turn import constant_turn_rate
from foretwin.sim_worker.vehicle.parameters import GRAVITY_MPS2

MOST_ASTRAY_M = 1.0
"""Who may be farther than this from where it is reckoned to be, is gone until measured again."""


def astray_m(vehicle: VehicleParameters, age_s: float) -> float:
    """Return how far from where it is reckoned a vehicle may be, measured `age_s` ago.

    Nothing foresees what its driver does next; no more comes of it than tyres hold on a dry road,
    in whichever direction: ½ µ g t².
    """
    return 0.5 * _grip_mps2(vehicle) * age_s**2


def reckoned_for_s(vehicle: VehicleParameters) -> float:
    """Return for how long after a measurement it is known to `MOST_ASTRAY_M` where it is."""
    return math.sqrt(2.0 * MOST_ASTRAY_M / _grip_mps2(vehicle))


def _grip_mps2(vehicle: VehicleParameters) -> float:
    return vehicle.friction.value * GRAVITY_MPS2


def reckoned(state: VehicleState, stamp_ns: int) -> VehicleState:
    """Return a state carried on to `stamp_ns` with its acceleration and yaw rate.

    One that is not older than `stamp_ns` is returned as it is.
    """
    age_s = (stamp_ns - state.stamp_ns) / 1e9
    if age_s <= 0.0:
        return state
    ((x_m, y_m, yaw_rad),) = constant_turn_rate(
        np.array([0.0, 0.0, state.yaw_rad]),
        speed_mps=state.speed_mps,
        accel_mps2=state.accel_mps2,
        yaw_rate_radps=state.yaw_rate_radps,
        time_s=np.array([age_s]),
    )
    here = LocalFrame(state.position)
    at = geo_pose(here, x_m, y_m, yaw_rad, alt_m=state.position.alt_m)
    speed_mps = state.speed_mps + state.accel_mps2 * age_s
    rests = speed_mps * state.speed_mps < 0.0
    return msgspec.structs.replace(
        state,
        stamp_ns=stamp_ns,
        position=at.position,
        yaw_rad=float(wrap_angle(np.float64(at.yaw_rad))),
        speed_mps=0.0 if rests else speed_mps,
        yaw_rate_radps=0.0 if rests else state.yaw_rate_radps,
        accel_mps2=0.0 if rests else state.accel_mps2,
    )
