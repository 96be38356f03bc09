"""Numbers act on the quantities that the table names, and a new one needs a row alone."""

from __future__ import annotations

from types import MappingProxyType

import numpy as np
import pytest

from foretwin.contracts import future_numbers, numbers
from foretwin.contracts.futures import Future
from foretwin.sim_worker.futures import number_columns as module
from foretwin.sim_worker.futures.number_columns import number_columns
from foretwin.sim_worker.planner_interface import PlannerOutput


def future(index: int, **numbers_: float) -> Future:
    return Future(index=index, name=str(index), numbers=numbers_)


def test_numbers_of_one_quantity_act_in_the_order_of_the_table() -> None:
    columns = number_columns([
        future(0), future(1, target_speed_factor=0.5, target_speed_offset_mps=1.0),
    ])  # fmt: skip
    aims = columns.applied("aim.target_speed_mps", 10.0)
    assert aims.tolist() == [10.0, 6.0]
    assert columns.applied("command.accel_mps2", 1.5).tolist() == [1.5, 1.5], "nothing acts on it"
    assert columns.factor("aim.target_speed_mps").tolist() == [1.0, 0.5]
    assert columns.of(np.array([1, 1])).applied("aim.target_speed_mps", 10.0).tolist() == [6.0, 6.0]


def test_actuators_spoil_what_is_commanded() -> None:
    columns = number_columns([
        future(0), future(1, brake_gain=0.5), future(2, steering_gain=0.5, steering_offset_rad=0.1),
    ])  # fmt: skip
    accel, angle = columns.spoil(PlannerOutput(np.full(3, -2.0), np.full(3, 0.2)))
    assert accel.tolist() == [-2.0, -1.0, -2.0]
    assert angle.tolist() == [0.2, 0.2, 0.2 * 0.5 + 0.1]
    accel, _ = columns.spoil(PlannerOutput(np.full(3, 2.0), np.full(3, 0.2)))
    assert accel.tolist() == [2.0, 2.0, 2.0]


def test_a_new_fault_of_a_known_quantity_is_one_row(monkeypatch: pytest.MonkeyPatch) -> None:
    more = dict(numbers.FUTURE_NUMBERS) | {
        "weak_engine_gain": numbers.FutureNumber(
            "1", "multiply", "command.accel_mps2", "of what is commanded", numbers.Range(0.0, 1.0)
        )
    }
    for place in (numbers, future_numbers, module):
        monkeypatch.setattr(place, "FUTURE_NUMBERS", MappingProxyType(more))
    columns = number_columns([future(0, weak_engine_gain=0.5)])
    accel, _ = columns.spoil(PlannerOutput(np.array([2.0]), np.zeros(1)))
    assert accel.tolist() == [1.0]
