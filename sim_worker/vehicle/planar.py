"""The planar vehicle as a MuJoCo spec: a chassis on x, y, yaw whose tyres are saturating actuators.

The body origin is the centre of gravity, so that the mass matrix is diagonal; `reference_points`
converts to base_link, the rear-axle centre. A lateral tyre force is a velocity
actuator at the axle, F = -(C / max(|u|, 1)) v_lat within ±limit, which implicit integration keeps
stable at 10 ms down to standstill; `vehicle.actuation` refreshes C and the limits.
"""

from __future__ import annotations

import math

import mujoco
import numpy as np

from foretwin.contracts.arrays import Array
from foretwin.contracts.vehicle import VehicleParameters
from foretwin.sim_worker.vehicle.parameters import GRAVITY_MPS2
from foretwin.sim_worker.vehicle.reference_points import box_centre_from_base_m
from foretwin.sim_worker.vehicle.timestep import TIMESTEP_S
from foretwin.world_gen.export.mjcf import ROAD_USER, STATIC, VEHICLE

MAX_STEERING_DELAY_S = 1.0
"""The longest delay the sample buffer of the steering actuator holds."""
_DELAY_SLACK_S = 1e-6
"""More than the rounding of a clock that runs for a day in steps, and less than any step."""

CHASSIS = "chassis"
TYRE_FRONT, TYRE_REAR, DRIVE, STEER = "tyre_front", "tyre_rear", "drive", "steer"
JOINTS = ("x", "y", "yaw", "steer")

_GROUND_CLEARANCE_M = 0.15
_STEER_MASS_KG = 0.1
_BRAKE_NS_PER_M = 2.0e5
_STEER_KP, _STEER_ARMATURE = 1.0e5, 1.0
LEAST_STEERING_LAG_S = 0.0065
"""Below it, the servo would overshoot."""


def history_samples(timestep_s: float) -> int:
    """Return how many control samples the steering buffer needs at `timestep_s`."""
    return math.ceil(MAX_STEERING_DELAY_S / timestep_s - 1e-9) + 2


def check_steering_delay(delay_s: Array | float) -> None:
    """Raise ValueError for a delay beyond the buffer, which MuJoCo would shorten silently."""
    delays = np.atleast_1d(np.asarray(delay_s, dtype=np.float64))
    if not np.all(np.isfinite(delays)) or delays.min() < 0.0:
        raise ValueError(f"steering delay {delays.min()} s must be zero or more")
    if delays.max() > MAX_STEERING_DELAY_S + 1e-9:
        raise ValueError(
            f"steering delay {delays.max():g} s is longer than the buffer of "
            f"{MAX_STEERING_DELAY_S:g} s"
        )


def read_delay_s(delay_s: Array | float) -> Array:
    """Return the delay that MuJoCo is to read for a command to act after `delay_s`, in whole steps.

    MuJoCo asks for the latest sample at the sum of all steps less the delay: of a delay of whole
    steps the rounding of that sum makes one step more from 2 s to 16 s of a drive.
    """
    return np.maximum(np.asarray(delay_s, dtype=np.float64) - _DELAY_SLACK_S, 0.0)


def vehicle_spec(
    vehicle: VehicleParameters, *, timestep_s: float = TIMESTEP_S, collides: bool = True
) -> mujoco.MjSpec:
    """Return the vehicle alone, to be attached to a world's spec.

    Options other than the timestep come from the world: `attach` keeps the parent's. Raises
    ValueError for a steering delay beyond the buffer.
    """
    check_steering_delay(vehicle.steering_delay_s.value)
    mass = vehicle.mass_kg.value
    wheelbase = vehicle.wheelbase_m.value
    rear = vehicle.cog_from_rear_axle_m.value
    yaw_inertia = vehicle.yaw_inertia_kgm2.value

    spec = mujoco.MjSpec()
    spec.modelname = vehicle.name
    set_physics_options(spec, timestep_s=timestep_s)
    chassis = spec.worldbody.add_body(name=CHASSIS, sleep=mujoco.mjtSleepPolicy.mjSLEEP_NEVER)
    slide, hinge = mujoco.mjtJoint.mjJNT_SLIDE, mujoco.mjtJoint.mjJNT_HINGE
    chassis.add_joint(name="x", type=slide, axis=[1, 0, 0])
    chassis.add_joint(name="y", type=slide, axis=[0, 1, 0])
    chassis.add_joint(name="yaw", type=hinge, axis=[0, 0, 1])
    chassis.explicitinertial = True
    chassis.mass = mass - _STEER_MASS_KG
    # Roll and pitch do not move here: any values that keep the triangle inequality will do.
    chassis.inertia = [yaw_inertia, yaw_inertia, yaw_inertia]

    height = vehicle.height_m.value
    chassis.add_geom(
        name="box",
        type=mujoco.mjtGeom.mjGEOM_BOX,
        size=[
            vehicle.length_m.value / 2.0,
            vehicle.width_m.value / 2.0,
            (height - _GROUND_CLEARANCE_M) / 2.0,
        ],
        pos=[box_centre_from_base_m(vehicle) - rear, 0.0, (height + _GROUND_CLEARANCE_M) / 2.0],
        mass=0.0,
        contype=VEHICLE if collides else 0,
        conaffinity=STATIC | ROAD_USER if collides else 0,
        rgba=[0.2, 0.5, 0.9, 1.0],
    )
    chassis.add_site(name="cog")
    chassis.add_site(name="axle_rear", pos=[-rear, 0.0, 0.0])
    knuckle = chassis.add_body(name="knuckle", pos=[wheelbase - rear, 0.0, 0.0])
    knuckle.explicitinertial = True
    knuckle.mass = _STEER_MASS_KG
    knuckle.inertia = [1e-3, 1e-3, 1e-3]
    knuckle.add_joint(name="steer", type=hinge, axis=[0, 0, 1], armature=_STEER_ARMATURE)
    knuckle.add_site(name="axle_front")

    _add_actuators(spec, vehicle, timestep_s=timestep_s)
    return spec


def set_physics_options(spec: mujoco.MjSpec, *, timestep_s: float = TIMESTEP_S) -> None:
    """Give `spec` the options that the planar vehicle was measured with."""
    option = spec.option
    option.timestep = timestep_s
    option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    option.cone = mujoco.mjtCone.mjCONE_ELLIPTIC
    # mujoco 4.0.0 has a wrong Newton Hessian with sparse Jacobians.
    option.jacobian = mujoco.mjtJacobian.mjJAC_DENSE
    option.gravity = [0.0, 0.0, -GRAVITY_MPS2]
    option.enableflags |= int(mujoco.mjtEnableBit.mjENBL_SLEEP)
    # Nothing here has springs, joint dampers, or a way to fall: their passes cost time alone.
    flags = mujoco.mjtDisableBit
    option.disableflags |= int(flags.mjDSBL_SPRING | flags.mjDSBL_DAMPER | flags.mjDSBL_GRAVITY)
    # A diverged car must stay diverged and be reported, not be put back to the origin.
    option.disableflags |= int(flags.mjDSBL_AUTORESET)


def _add_actuators(spec: mujoco.MjSpec, vehicle: VehicleParameters, *, timestep_s: float) -> None:
    site, joint = mujoco.mjtTrn.mjTRN_SITE, mujoco.mjtTrn.mjTRN_JOINT
    affine, fixed = mujoco.mjtBias.mjBIAS_AFFINE, mujoco.mjtGain.mjGAIN_FIXED
    rows = (
        (TYRE_FRONT, "axle_front", [0, 1, 0, 0, 0, 0], 0.0, 1000.0),
        (TYRE_REAR, "axle_rear", [0, 1, 0, 0, 0, 0], 0.0, 1000.0),
        (DRIVE, "cog", [1, 0, 0, 0, 0, 0], 1.0, _BRAKE_NS_PER_M),
    )
    for name, target, gear, gain, damping in rows:
        actuator = spec.add_actuator(name=name, trntype=site, target=target, gear=gear)
        actuator.gaintype, actuator.biastype = fixed, affine
        actuator.gainprm[0] = gain
        actuator.biasprm[2] = -damping
        actuator.forcelimited = True
        actuator.forcerange = [-1e-9, 1e-9]
    limit = vehicle.max_tire_angle_rad.value
    steer = spec.add_actuator(name=STEER, trntype=joint, target="steer")
    lag = max(vehicle.steering_lag_s.value, LEAST_STEERING_LAG_S)
    steer.set_to_position(kp=_STEER_KP, kv=_STEER_KP * lag)
    steer.ctrllimited = True
    steer.ctrlrange = [-limit, limit]
    steer.nsample = history_samples(timestep_s)
    steer.delay = float(read_delay_s(vehicle.steering_delay_s.value))
