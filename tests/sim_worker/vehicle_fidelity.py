"""How near the planar vehicle comes to CommonRoad's models and to the analytic understeer formula.

    python -m tests.sim_worker.vehicle_fidelity [VEHICLE ...]

prints the figures as a table; one vehicle takes about half a minute of CPU.
"""

from __future__ import annotations

import sys
from typing import NamedTuple

import numpy as np

from foretwin.contracts.arrays import Array
from foretwin.contracts.vehicle import VehicleParameters
from foretwin.sim_worker.batch.batch_simulation import BatchSimulation, Controls
from foretwin.sim_worker.vehicle.parameters import GRAVITY_MPS2, load_vehicle, understeer_gradient
from tests.sim_worker import commonroad_drives
from tests.sim_worker.commonroad_drives import NUMBERS, Drive, Kind
from tests.sim_worker.driving import altered, seed, states

TIRES_RAD = (0.02, 0.05, 0.1, 0.2)
SPEEDS_MPS = (5.0, 10.0, 15.0)
STEPS = ((5.0, 0.1), (10.0, 0.05), (15.0, 0.03))
"""Speed and tyre angle of the step steers."""
STOPS = ((15.0, 4.0), (15.0, 8.0), (10.0, 4.0))
"""Speed and commanded deceleration of the stops."""
_KINDS: tuple[Kind, ...] = ("single-track", "multi-body")
_TURN_S, _STEP_S, _STEP_AT_S = 5.0, 4.0, 0.5
_MAX_LATERAL_MPS2 = 9.0
_STOPPED_MPS = 0.2


class Fidelity(NamedTuple):
    """Relative errors of a vehicle against one of CommonRoad's models.

    `radius` (C,) of steady turns, `step_steer` the root mean square of the yaw rate's error over
    the steady yaw rate, one for each of `STEPS`, `braking` of the stopping distance, one for each
    of `STOPS`.
    """

    radius: Array
    step_steer: Array
    braking: Array


def immediate(vehicle: VehicleParameters) -> VehicleParameters:
    """Return `vehicle` as CommonRoad's models are: without delays, lags and resistances."""
    return altered(
        vehicle, steering_delay_s=0.0, steering_lag_s=0.0, drive_lag_s=0.0, brake_lag_s=0.0,
        accel_delay_s=0.0, drag_npv2=0.0, rolling_resistance_n=0.0,
    )  # fmt: skip


def turns(vehicle: VehicleParameters) -> list[tuple[float, float]]:
    """Return speed and tyre angle of the steady turns that tyres can hold."""
    return [
        (speed, tire)
        for speed in SPEEDS_MPS
        for tire in TIRES_RAD
        if speed**2 * np.tan(tire) / vehicle.wheelbase_m.value <= _MAX_LATERAL_MPS2
    ]


def fidelity(name: str, kind: Kind) -> Fidelity:
    """Measure the bundled vehicle `name` against CommonRoad's model of it."""
    vehicle = immediate(load_vehicle(name))
    if kind == "single-track":
        # Its wheels have no inertia.
        vehicle = altered(vehicle, wheel_inertia_mass_factor=1.0)
    cases = turns(vehicle)
    ours = _radii(_held(vehicle, cases, duration_s=_TURN_S))
    theirs = np.array([_reference_radius(name, kind, *case) for case in cases])
    return Fidelity(
        ours / theirs - 1.0,
        _step_steer_errors(name, kind, vehicle),
        _stopping_distances(vehicle) / np.array([_stop(name, kind, *stop) for stop in STOPS]) - 1.0,
    )


def understeer_errors(vehicle: VehicleParameters, cases: tuple[tuple[float, float], ...]) -> Array:
    """Return the relative error of the steady yaw rate, r = v δ / (L + K v²), in each case.

    Gillespie (1992), Fundamentals of Vehicle Dynamics, equation 6-18, with tan δ for δ.
    """
    speed, tire = np.array(cases).T
    path = _held(immediate(vehicle), list(cases), duration_s=8.0)
    wanted = np.tan(tire) / (
        vehicle.wheelbase_m.value + understeer_gradient(vehicle) * np.square(speed)
    )
    return np.asarray(1.0 / _radii(path) / wanted - 1.0)


def lateral_cases(vehicle: VehicleParameters) -> tuple[tuple[float, float], ...]:
    """Return speeds and tyre angles for lateral accelerations of 1.5 and 3 m/s²."""
    length, gradient = vehicle.wheelbase_m.value, understeer_gradient(vehicle)
    return tuple(
        (speed, float(np.arctan(lateral * (length + gradient * speed**2) / speed**2)))
        for speed in (5.0, 10.0, 15.0, 20.0)
        for lateral in (1.5, 3.0)
        if lateral * length / speed**2 < 0.3
    )


def _held(
    vehicle: VehicleParameters, cases: list[tuple[float, float]], *, duration_s: float
) -> Array:
    """Return states (S, N, 8) of turns at a held speed, steered from the start."""
    return _drive(vehicle, cases, duration_s=duration_s, steer_at_s=0.0)


def _drive(
    vehicle: VehicleParameters, cases: list[tuple[float, float]], *,
    duration_s: float, steer_at_s: float,
) -> Array:  # fmt: skip
    stage = BatchSimulation(None, vehicle, nsim=len(cases))
    speed, tire = np.array(cases).T
    seed(stage, states(len(cases), speed=speed))
    record, sum_of_errors = [stage.states.copy()], np.zeros(len(cases))
    for tick in range(round(duration_s / stage.control_dt_s)):
        error = speed - stage.states[:, 3]
        sum_of_errors += error * stage.control_dt_s
        angle = tire if (tick + 0.5) * stage.control_dt_s > steer_at_s else 0.0 * tire
        stage.step(Controls(np.clip(5.0 * error + 3.0 * sum_of_errors, -5.0, 5.0), angle))
        record.append(stage.states.copy())
    return np.stack(record, axis=1)


def _radii(path: Array) -> Array:
    late = path[:, -10:]
    return np.asarray(late[:, :, 3].mean(axis=1) / late[:, :, 5].mean(axis=1))


def _reference_radius(name: str, kind: Kind, speed: float, tire: float) -> float:
    theirs = commonroad_drives.drive(
        name, kind, speed_mps=speed, duration_s=_TURN_S, tire=lambda _: tire
    )
    late = theirs.time_s > _TURN_S - 0.5
    return float(theirs.speed_mps[late].mean() / theirs.yaw_rate_radps[late].mean())


def _step_steer_errors(name: str, kind: Kind, vehicle: VehicleParameters) -> Array:
    path = _drive(vehicle, list(STEPS), duration_s=_STEP_S, steer_at_s=_STEP_AT_S)
    time_s = np.linspace(0.0, _STEP_S, path.shape[1])
    errors = []
    for (speed, tire), ours in zip(STEPS, path, strict=True):
        theirs = commonroad_drives.drive(
            name, kind, speed_mps=speed, duration_s=_STEP_S,
            tire=lambda t, tire=tire: tire if t >= _STEP_AT_S else 0.0,
        )  # fmt: skip
        # Compared at our instants, the last of which the reference does not reach.
        there = time_s <= theirs.time_s[-1]
        rate = np.interp(time_s[there], theirs.time_s, theirs.yaw_rate_radps)
        error = ours[there, 5] - rate
        errors.append(np.sqrt(np.square(error).mean()) / theirs.yaw_rate_radps[-200:].mean())
    return np.array(errors)


def _stopping_distances(vehicle: VehicleParameters) -> Array:
    stage = BatchSimulation(None, vehicle, nsim=len(STOPS))
    speed, decel = np.array(STOPS).T
    seed(stage, states(len(STOPS), speed=speed))
    record = [stage.states.copy()]
    for _ in range(120):
        stage.step(Controls(-decel, np.zeros(len(STOPS))))
        record.append(stage.states.copy())
    path = np.stack(record, axis=1)
    return np.array([_way_until_stopped(ours[:, 3], ours[:, 0]) for ours in path])


def _stop(name: str, kind: Kind, speed: float, decel: float) -> float:
    theirs: Drive = commonroad_drives.drive(
        name, kind, speed_mps=speed, duration_s=speed / decel * 1.3 + 0.3,
        accel=lambda v: -decel if v > 0.15 else 0.0,
    )  # fmt: skip
    return _way_until_stopped(theirs.speed_mps, theirs.x_m)


def _way_until_stopped(speed: Array, x: Array) -> float:
    """Return where the speed falls to `_STOPPED_MPS`, from where it began."""
    first = int(np.argmax(speed < _STOPPED_MPS))
    share = (speed[first - 1] - _STOPPED_MPS) / (speed[first - 1] - speed[first])
    return float(x[first - 1] + share * (x[first] - x[first - 1]) - x[0])


def _print(names: list[str]) -> None:
    for name in names:
        vehicle = load_vehicle(name)
        if name in NUMBERS:
            for kind in _KINDS:
                got = fidelity(name, kind)
                radius = 100.0 * np.abs(got.radius)
                print(f"{name} against CommonRoad's {kind} model")
                print(
                    f"  steady radius, mean / max error: {radius.mean():.2f} / {radius.max():.2f} %"
                )
                steer = " / ".join(f"{100.0 * error:.2f}" for error in got.step_steer)
                print(f"  step steer at 5 / 10 / 15 m/s, RMSE of the yaw rate: {steer} %")
                brake = " / ".join(f"{100.0 * error:+.2f}" for error in got.braking)
                print(f"  stopping distance, 15 m/s at 4 and 8, 10 m/s at 4 m/s²: {brake} %")
        errors = np.abs(100.0 * understeer_errors(vehicle, lateral_cases(vehicle)))
        gradient = np.rad2deg(understeer_gradient(vehicle)) * GRAVITY_MPS2
        print(f"{name} against r = v tan(d) / (L + K v²), K = {abs(gradient):.2f} deg/g")
        print(f"  steady yaw rate, mean / max error: {errors.mean():.2f} / {errors.max():.2f} %")


if __name__ == "__main__":
    _print(sys.argv[1:] or [*NUMBERS, "lorry_12t", "city_bus"])
