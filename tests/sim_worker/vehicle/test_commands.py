"""The car's commands as the twin remembers them, and those estimated from its motion."""

from __future__ import annotations

import numpy as np
import pytest

from foretwin.contracts.drive import ControlCommand
from foretwin.sim_worker.driver_model import HOLD_MPS2
from foretwin.sim_worker.vehicle.commands import (
    HELD_NS,
    STEP_BACK_NS,
    CommandMemory,
    estimated_command,
)
from foretwin.sim_worker.vehicle.parameters import load_vehicle
from tests.sim_worker.driving import altered

CAR = altered(load_vehicle(), steering_offset_rad=0.0, steering_ratio=16.0)


def command(
    stamp_ns: int, accel_mps2: float = 1.0, angle_rad: float | None = 0.1
) -> ControlCommand:
    return ControlCommand(stamp_ns=stamp_ns, accel_mps2=accel_mps2, tire_angle_rad=angle_rad)


def test_a_command_holds_until_the_next_and_none_before_the_first() -> None:
    memory = CommandMemory(CAR, keep_s=10.0)
    for stamp_ns in (10, 20, 15):
        memory.add(command(stamp_ns, accel_mps2=float(stamp_ns)))
    assert memory.at(9) is None
    held = [found.accel_mps2 for t in (10, 19, 20, 99) if (found := memory.at(t)) is not None]
    assert held == [10.0, 10.0, 20.0, 20.0], "one from before the latest is ignored"


def test_a_command_without_another_after_it_holds_no_longer_once_lost() -> None:
    memory = CommandMemory(CAR, keep_s=10.0)
    memory.add(command(10))
    assert memory.at(10 + HELD_NS) is not None
    assert memory.at(11 + HELD_NS) is None
    assert memory.angles_before(11 + HELD_NS, count=2, step_ns=1) is None
    memory.add(command(4 * HELD_NS))
    assert memory.at(4 * HELD_NS) is not None


def test_what_is_commanded_while_a_human_drives_moves_nothing() -> None:
    memory = CommandMemory(CAR, keep_s=10.0)
    memory.add(command(10, angle_rad=0.3))
    memory.human_drives(30)
    memory.add(command(20, angle_rad=0.3))
    assert memory.at(20) is None
    assert memory.at(35) is None
    memory.add(command(40))
    assert memory.at(40) is not None
    assert memory.angles_before(40, count=3, step_ns=10) == pytest.approx([0.1, 0.1, 0.1])
    memory.add(command(40 - 2 * STEP_BACK_NS))
    assert memory.at(40 - 2 * STEP_BACK_NS) is not None, "the clock has stepped back"


def test_a_steering_wheel_is_turned_into_tyres_and_without_either_the_last_angle_holds() -> None:
    memory = CommandMemory(CAR, keep_s=10.0)
    memory.add(ControlCommand(stamp_ns=1, accel_mps2=0.0, steering_wheel_rad=1.6, estimated=True))
    memory.add(command(2, angle_rad=None))
    angles = memory.angles_before(2, count=2, step_ns=1)
    assert angles == pytest.approx([0.1, 0.1])
    assert memory.estimated
    assert memory.angles_before(0, count=2, step_ns=1) is None


def test_what_is_older_than_is_kept_goes_but_for_the_one_that_still_holds() -> None:
    memory = CommandMemory(CAR, keep_s=1.0)
    for second in range(5):
        memory.add(command(second * 1_000_000_000))
    memory.forget_before(4_500_000_000)
    assert memory.at(2_900_000_000) is None
    assert memory.at(3_500_000_000) is not None


def test_a_clock_that_steps_back_begins_anew() -> None:
    memory = CommandMemory(CAR, keep_s=100.0)
    memory.add(command(5 * STEP_BACK_NS))
    memory.add(command(STEP_BACK_NS, accel_mps2=3.0))
    found = memory.at(STEP_BACK_NS + 1)
    assert found is not None
    assert found.accel_mps2 == 3.0


def test_an_estimated_command_undoes_gain_and_resistance() -> None:
    car = altered(CAR, drag_npv2=0.0, rolling_resistance_n=0.0, drive_gain=0.8)
    before, after = np.zeros(8), np.zeros(8)
    before[3], after[3] = 10.0, 10.1
    found = estimated_command(car, before, after, stamp_ns=7, duration_s=0.1)
    assert found.stamp_ns == 7
    assert found.accel_mps2 == pytest.approx(car.wheel_inertia_mass_factor.value / 0.8)
    standing = estimated_command(car, np.zeros(8), np.zeros(8), stamp_ns=7, duration_s=0.1)
    assert standing.accel_mps2 == HOLD_MPS2
