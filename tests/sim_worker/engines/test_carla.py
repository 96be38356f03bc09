"""What is said to a CARLA server, by one of a few lines: none was at hand."""

from __future__ import annotations

import importlib.util

import numpy as np
import pytest

from foretwin.sim_worker.engines.carla import Carla, trouble_with_carla
from foretwin.sim_worker.engines.engine import Demand, Seeds
from foretwin.sim_worker.engines.registry import begin_engine, trouble_with_engine
from foretwin.sim_worker.vehicle.parameters import load_vehicle
from tests.sim_worker.engines import fake_carla

CAR = load_vehicle()


def begun(yaw: float = 0.0) -> tuple[fake_carla.World, Carla]:
    fake_carla.WORLDS.append(fake_carla.World())
    engine = Carla(CAR, package=fake_carla)
    state = np.array([[10.0, 5.0, yaw, 8.0, 0.0, 0.0, 0.1, 0.0]])
    engine.reset(np.array([0]), Seeds(state, np.ones(1), np.zeros(1, dtype=bool)))
    return fake_carla.WORLDS[-1], engine


def demand(*, drive: float = 0.0, brake: float = 0.0, angle: float = 0.0) -> Demand:
    given = (np.array([value]) for value in (drive, brake, 0.0))
    return Demand(*given, np.full((5, 1), angle))


@pytest.mark.parametrize("yaw", [0.0, 0.5, -2.0])
def test_a_car_rolls_on_from_where_it_begins_whichever_way_axes_point(yaw: float) -> None:
    _, engine = begun(yaw)
    now = engine.step(demand())[:, 0]
    ahead = np.array([np.cos(yaw), np.sin(yaw)])
    assert now[:2] == pytest.approx(np.array([10.0, 5.0]) + 0.05 * 8.0 * ahead)
    assert now[2:5] == pytest.approx([yaw, 8.0, 0.0])


def test_commands_become_shares_of_what_the_car_can_do() -> None:
    server, engine = begun()
    angle = engine.step(demand(drive=2.0, angle=0.2))[6, 0]
    control = server.actors[0].controls[-1]
    assert control.throttle == 2.0 / CAR.max_drive_accel_mps2.value
    assert control.brake == 0.0
    assert control.steer == pytest.approx(-0.2 / CAR.max_tire_angle_rad.value)
    assert angle == 0.2
    engine.step(demand(drive=-1.0, brake=50.0))
    assert server.actors[0].controls[-1].reverse
    assert server.actors[0].controls[-1].brake == 1.0


def test_the_server_goes_by_our_clock_and_has_its_own_back_afterwards() -> None:
    server, engine = begun()
    assert server.settings.synchronous_mode
    assert server.settings.fixed_delta_seconds == 0.01
    engine.close()
    assert not server.settings.synchronous_mode
    assert not server.actors[0].there


def test_what_cannot_be_is_said_in_one_line(monkeypatch: pytest.MonkeyPatch) -> None:
    with monkeypatch.context() as silent:
        silent.setattr(fake_carla.Client, "answers", False)
        with pytest.raises(ValueError, match=r"engine 'carla' at 127\.0\.0\.1:2000: time-out"):
            Carla(CAR, package=fake_carla)
    _, engine = begun()
    two = Seeds(np.zeros((2, 8)), np.ones(2), np.zeros(2, dtype=bool))
    with pytest.raises(ValueError, match="jobs of one future"):
        engine.reset(np.arange(2), two)


@pytest.mark.skipif(importlib.util.find_spec("carla") is not None, reason="CARLA's package is here")
def test_without_its_package_it_says_so() -> None:
    assert trouble_with_engine("carla") == trouble_with_carla()
    with pytest.raises(ValueError, match="needs CARLA's Python package"):
        begin_engine("carla", CAR, count=1)
