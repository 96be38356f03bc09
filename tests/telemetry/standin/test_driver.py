"""The stand-in's driver where its path bends more sharply than any car can turn."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest

from foretwin.contracts.frames import geo_from_local
from foretwin.telemetry.standin.car import STEP_S, CarMotion, MultiBodyCar
from foretwin.telemetry.standin.driver import Driver
from foretwin.telemetry.standin.parameters import read_parameters
from foretwin.telemetry.standin.path import DrivenPath
from tests.telemetry.standin_drive import FRAME

_CONTROL_TICKS = round(0.020 / STEP_S)
Corners = list[tuple[float, float]]

KINKS: dict[str, Corners] = {
    "turns back between carriageways": [(0, 0), (80, 0), (82, 4), (70, 5), (0, 6), (-90, 6)],
    "turns back, then off": [(0, 0), (60, 0), (61, 3), (52, 5), (52, 60), (52, 160)],
    "two corners 3 m apart": [(0, 0), (60, 0), (60, 3), (150, 3), (200, 3)],
}


def path_of(corners: Corners) -> DrivenPath:
    points = [np.array(corners[:1], dtype=float)]
    for start, end in itertools.pairwise(corners):
        count = max(1, round(math.dist(start, end)))
        points.append(np.linspace(start, end, count + 1)[1:])
    geo = geo_from_local(FRAME, np.concatenate(points))
    wished = np.full(len(geo), 12.0)
    return DrivenPath(geo[:, 0], geo[:, 1], wished, driver=read_parameters().driver)


def driven(path: DrivenPath, *, end_s: float) -> tuple[Driver, list[tuple[float, CarMotion]]]:
    """Drive from the path's beginning; returns where along it each motion was."""
    given, start = read_parameters(), path.at(0.0)
    car = MultiBodyCar(given.car, x_m=start.x_m, y_m=start.y_m, yaw_rad=start.yaw_rad)
    driver = Driver(
        path=path,
        parameters=given.driver,
        car=given.car,
        wheelbase_m=car.wheelbase_m,
        period_s=_CONTROL_TICKS * STEP_S,
    )
    motions = []
    for _ in range(round(end_s / (_CONTROL_TICKS * STEP_S))):
        asked = driver.command(motion := car.motion())
        motions.append((driver.s_m, motion))
        for _ in range(_CONTROL_TICKS):
            car.step(accel_mps2=asked.accel_mps2, steering_wheel_rad=asked.steering_wheel_rad)
        if driver.arrived:
            break
    return driver, motions


@pytest.mark.parametrize("kinks", KINKS)
def test_a_car_that_is_carried_off_its_path_slows_down_and_comes_back(kinks: str) -> None:
    path = path_of(KINKS[kinks])
    driver, motions = driven(path, end_s=90.0)
    assert driver.arrived
    sideways = [abs(motion.vx_mps * motion.yaw_rate_radps) for _, motion in motions]
    assert max(sideways) < 3.5
    offsets = []
    for s_m, motion in motions:
        if s_m > path.length_m - 30.0:
            here = path.at(s_m)
            offsets.append(math.hypot(motion.x_m - here.x_m, motion.y_m - here.y_m))
    assert max(offsets) < 0.6
