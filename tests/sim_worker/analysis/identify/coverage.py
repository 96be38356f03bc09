"""How often 95 % intervals hold the truth: many cars, each on a way of its own.

Cars are drawn far more widely than the bundled file expects (its understeer gradient is at the edge
of what is drawn), and none of the drawn values is told: intervals hold for each car by itself, not
on the average over cars like the file's.

    python -m tests.sim_worker.analysis.identify.coverage [CARS [FIRST_SEED]]

prints, for each parameter, how many of the intervals held the truth, how many values were as near
as they should be, how far they were off, and the intervals' median half width; a car takes some
seconds of CPU.
"""

from __future__ import annotations

import functools
import math
import sys
from collections.abc import Iterable
from typing import NamedTuple

import msgspec
import numpy as np

from foretwin.contracts.frames import geo_from_local
from foretwin.contracts.vehicle import VehicleParameters
from foretwin.sim_worker.analysis.identify.window import UNDERSTEER_NAME, identify
from foretwin.sim_worker.analysis.motion_record import MotionRecord
from foretwin.sim_worker.vehicle.parameters import load_vehicle
from foretwin.telemetry.standin.car import STEP_S, CarMotion, MultiBodyCar
from foretwin.telemetry.standin.parameters import CarParameters, StandinParameters, read_parameters
from foretwin.telemetry.standin.path import DrivenPath
from tests.sim_worker.standin_drives import MINUTE_S, driven, estimate, recorded
from tests.telemetry.standin_drive import FRAME

RELATIVE = {"steering_ratio": 0.02, "drive_gain": 0.03, "brake_gain": 0.03}
ABSOLUTE = {
    "steering_offset_rad": math.radians(0.2),
    UNDERSTEER_NAME: 0.0003,
    "steering_delay_s": 0.010,
    "accel_delay_s": 0.010,
}
"""What a minute in town should tell a parameter to."""


class Case(NamedTuple):
    """One interval and the truth that it should hold."""

    name: str
    truth: float
    value: float
    low: float
    high: float

    @property
    def holds(self) -> bool:
        """Whether the truth lies in the interval."""
        return self.low <= self.truth <= self.high

    @property
    def near(self) -> bool:
        """Whether the value is as near the truth as it should be after a minute in town."""
        reach = ABSOLUTE.get(self.name, RELATIVE.get(self.name, math.inf) * abs(self.truth))
        return abs(self.value - self.truth) <= reach


def random_parameters(random: np.random.Generator) -> StandinParameters:
    """Return a stand-in car that differs from the bundled one in what is identified."""
    given = read_parameters()
    car = msgspec.structs.replace(
        given.car,
        steering_ratio=random.uniform(13.0, 18.0),
        steering_offset_rad=random.uniform(-0.008, 0.008),
        steering_delay_s=0.005 * random.integers(10, 36),
        drive_delay_s=0.005 * random.integers(6, 30),
        drive_gain=random.uniform(0.85, 1.1),
        brake_gain=random.uniform(0.9, 1.15),
        drag_npv2=random.uniform(0.3, 0.6),
        rolling_resistance_n=random.uniform(80.0, 200.0),
        steering_compliance_rad_per_mps2=random.uniform(0.0, 0.003),
    )
    return msgspec.structs.replace(given, car=car)


def random_path(
    random: np.random.Generator,
    parameters: StandinParameters,
    *,
    length_m: float = 700.0,
    radii_m: tuple[float, float] = (12.0, 40.0),
) -> DrivenPath:
    """Return streets with bends of these radii, and a stop or two."""
    x, y, yaw = 0.0, 0.0, 0.0
    points = [(x, y)]
    while len(points) < length_m:
        radius = random.uniform(*radii_m)
        turn = random.choice([-1.0, 1.0]) * random.uniform(0.8, 1.6)
        for length, curvature in (
            (random.uniform(30.0, 90.0), 0.0),
            (radius * abs(turn), math.copysign(1.0 / radius, turn)),
        ):
            for _ in range(round(length)):
                x += math.cos(yaw + 0.5 * curvature)
                y += math.sin(yaw + 0.5 * curvature)
                yaw += curvature
                points.append((x, y))
    geo = geo_from_local(FRAME, np.array(points))
    wish = np.full(len(points), random.uniform(10.0, 14.0))
    wish[round(random.uniform(120.0, 300.0))] = 0.0
    return DrivenPath(geo[:, 0], geo[:, 1], wish, driver=parameters.driver)


def believed(random: np.random.Generator) -> VehicleParameters:
    """Return the file as its owner would write it: the wheelbase measured as well as it says.

    The intervals of the ratio hold that doubt, so the wheelbase must be wrong by as much. All other
    parameters of the file are the same for all cars, near the truth or not: intervals must hold for
    each car by itself.
    """
    vehicle = load_vehicle()
    base = vehicle.wheelbase_m
    assert base.std is not None
    given = msgspec.structs.replace(base, value=base.value + base.std * random.standard_normal())
    return msgspec.structs.replace(vehicle, wheelbase_m=given)


@functools.cache
def own_gradient() -> float:
    """Return the bare stand-in's understeer gradient, rad per m/s², from steady circles.

    It has roll and camber, so that its own differs from 0 and a little from speed to speed.
    """
    car = msgspec.structs.replace(
        read_parameters().car,
        steering_offset_rad=0.0,
        drag_npv2=0.0,
        rolling_resistance_n=0.0,
        drive_gain=1.0,
    )
    vehicle = load_vehicle()
    base, rear = vehicle.wheelbase_m.value, vehicle.cog_from_rear_axle_m.value
    soft = vehicle.mass_kg.value * (base - rear) / base
    soft /= vehicle.rear_cornering_stiffness_npr.value
    found = []
    for speed_mps in (6.0, 8.0, 10.0, 12.0):
        for wanted_mps2 in (1.0, 2.0):
            tyre_rad = math.atan(wanted_mps2 / speed_mps**2 * base)
            body = MultiBodyCar(car, x_m=0.0, y_m=0.0, yaw_rad=0.0, speed_mps=speed_mps)
            motions = []
            for _ in range(round(5.0 / STEP_S)):
                motions.append(body.motion())
                body.step(
                    accel_mps2=max(3.0 * (speed_mps - motions[-1].vx_mps), 0.0),
                    steering_wheel_rad=tyre_rad * car.steering_ratio,
                )
            steady = np.mean(motions[-200:], axis=0)
            motion = CarMotion(*steady)
            slip = soft * motion.accel_y_mps2
            turned = math.atan(base * motion.yaw_rate_radps / motion.vx_mps - slip) + slip
            found.append((motion.tire_angle_rad - turned) / motion.accel_y_mps2)
    return float(np.mean(found))


def truths(car: CarParameters) -> dict[str, float]:
    """Return what the intervals should hold, by parameter."""
    return {
        "steering_ratio": car.steering_ratio,
        "steering_offset_rad": car.steering_offset_rad,
        UNDERSTEER_NAME: own_gradient() + car.steering_compliance_rad_per_mps2,
        "steering_delay_s": car.steering_delay_s,
        "drive_gain": car.drive_gain,
        "brake_gain": car.brake_gain,
        "drag_npv2": car.drag_npv2,
        "accel_delay_s": car.drive_delay_s,
    }


def cases(seed: int) -> list[Case]:
    """Return the intervals from a minute of one random car on a random way."""
    random = np.random.default_rng(seed)
    parameters = random_parameters(random)
    path = random_path(random, parameters)
    drive = driven(path, parameters, seed=seed, end_s=MINUTE_S)
    return cases_of(recorded(drive.samples), parameters.car, believed(random))


def cases_of(record: MotionRecord, car: CarParameters, vehicle: VehicleParameters) -> list[Case]:
    """Return the intervals that a record gives of a car whose file is `vehicle`."""
    told = identify(record, vehicle, vehicle_id="standin")
    result = []
    for name, truth in truths(car).items():
        found = estimate(told, name)
        if found.value is not None and found.low is not None and found.high is not None:
            result.append(Case(name, truth, found.value, found.low, found.high))
    return result


def coverage(told: Iterable[Case]) -> dict[str, tuple[int, int]]:
    """Return how many intervals held the truth, and of how many, by parameter."""
    counts: dict[str, tuple[int, int]] = {}
    for case in told:
        held, of = counts.get(case.name, (0, 0))
        counts[case.name] = (held + case.holds, of + 1)
    return counts


def main() -> None:
    """Print the coverage."""
    count = int(sys.argv[1]) if len(sys.argv) > 1 else 100
    first = int(sys.argv[2]) if len(sys.argv) > 2 else 0
    told = [case for seed in range(first, first + count) for case in cases(seed)]
    for name, (held, of) in coverage(told).items():
        mine = [case for case in told if case.name == name]
        errors = np.array([case.value - case.truth for case in mine])
        half = np.median([0.5 * (case.high - case.low) for case in mine])
        near = sum(case.near for case in mine)
        print(
            f"{name:34} {held:3} of {of:3} held, {near:3} near; error {np.median(errors):+.5f} "
            f"± {np.std(errors):.5f}, nine of ten within {np.quantile(np.abs(errors), 0.9):.5f}, "
            f"half interval {half:.5f}"
        )


if __name__ == "__main__":
    main()
