"""What a vehicle's filter and its latest samples say together: the state that is reported."""

from __future__ import annotations

import math
from typing import NamedTuple

from foretwin.contracts.drive import GnssFix, VehicleState
from foretwin.contracts.frames import GeoPoint, wrap_angle
from foretwin.telemetry.estimator.filter_state import ACCEL, CURVATURE, SPEED, YAW, X, Y
from foretwin.telemetry.estimator.innovations import SurpriseCount, Surprises
from foretwin.telemetry.estimator.kinematic_filter import KinematicFilter
from foretwin.telemetry.estimator.map_aid import ALIKE_M
from foretwin.telemetry.estimator.measured import MotionSamples
from foretwin.telemetry.estimator.mounting import Mounting
from foretwin.telemetry.estimator.position_corrections import PositionCorrections
from foretwin.telemetry.estimator.told_spreads import Stretched


class StateConsistency(NamedTuple):
    """Whether an estimate is as good as it says.

    `surprises` by channel; the spreads that states tell are `widened` so many times now because
    sources contradict each other, and `stretched` because they were too small or too large;
    `position_noise_m` is what the newest fix is taken for, None before there is one; the receiver
    has slipped `slips` times, and sits as `mounting` says.
    """

    surprises: dict[str, Surprises]
    widened: float
    stretched: Stretched
    position_noise_m: float | None
    slips: int
    mounting: Mounting


def consistency_of(
    positions: PositionCorrections,
    fix: GnssFix | None,
    *,
    surprises: SurpriseCount,
    mounting: Mounting,
) -> StateConsistency:
    """Return how good estimates are of which `fix` is the newest position."""
    noise = positions.noise
    noise_m = None if fix is None else math.hypot(noise.std_m(fix), noise.hidden_std_m(fix))
    return StateConsistency(
        surprises.counts,
        positions.overconfidence,
        positions.stretched,
        noise_m,
        positions.slips,
        mounting,
    )


def unmoved_state(
    measured: MotionSamples,
    vehicle_id: str,
    stamp_ns: int,
    position: GeoPoint,
    position_std_m: float | None,
) -> VehicleState:
    """Return the state of a car that has not moved yet: it is somewhere, its heading unknown."""
    estimated = measured.estimated(stamp_ns)
    return VehicleState(
        vehicle_id=vehicle_id,
        stamp_ns=stamp_ns,
        position=position,
        yaw_rad=0.0,
        speed_mps=0.0 if "speed_mps" in estimated else measured.speed_mps,
        yaw_rate_radps=0.0,
        accel_mps2=0.0,
        tire_angle_rad=None if "tire_angle_rad" in estimated else measured.tire_angle_rad,
        steering_wheel_rad=measured.steering_wheel_rad,
        position_std_m=position_std_m,
        estimated=estimated,
        yaw_valid=False,
    )


def moving_state(
    measured: MotionSamples,
    vehicle_id: str,
    stamp_ns: int,
    position: GeoPoint,
    filter_: KinematicFilter,
    *,
    convergence_rad: float,
    standing: bool,
    map_shift_m: tuple[float, float] | None,
    overconfidence: float = 1.0,
    stretched: Stretched,
    hidden_std_m: float = 0.0,
) -> VehicleState:
    """Return the state of a car whose heading is known.

    `overconfidence` is by how much the filter's spreads are too small while its sources contradict
    each other, `stretched` what its states' errors were found to be of what is told, `hidden_std_m`
    what lies under all positions alike.
    `convergence_rad` is the angle of the filter's frame against east; a car that stands has no
    speed, turning or acceleration. Fields without a fresh sample are named in `estimated`.
    """
    estimated = measured.estimated(stamp_ns)
    angle = None if "tire_angle_rad" in estimated else measured.tire_angle_rad
    if angle is None:
        angle = math.atan(measured.wheelbase_m * filter_.mean[CURVATURE])
    variance = filter_.covariance.item
    position_std_m = (
        overconfidence * stretched.place * math.sqrt(0.5 * (variance(X, X) + variance(Y, Y)))
    )
    position_std_m = math.hypot(position_std_m, hidden_std_m)
    if map_shift_m is not None:
        position_std_m = math.hypot(position_std_m, ALIKE_M)
    return VehicleState(
        vehicle_id=vehicle_id,
        stamp_ns=stamp_ns,
        position=position,
        yaw_rad=float(wrap_angle(filter_.mean[YAW] - convergence_rad)),
        speed_mps=0.0 if standing else float(filter_.mean[SPEED]),
        yaw_rate_radps=0.0 if standing else filter_.yaw_rate_radps,
        accel_mps2=0.0 if standing else float(filter_.mean[ACCEL]),
        tire_angle_rad=angle,
        steering_wheel_rad=measured.steering_wheel_rad,
        position_std_m=position_std_m,
        yaw_std_rad=overconfidence * stretched.yaw * math.sqrt(variance(YAW, YAW)),
        speed_std_mps=overconfidence * stretched.speed * math.sqrt(variance(SPEED, SPEED)),
        map_shift_m=map_shift_m,
        estimated=estimated,
    )
