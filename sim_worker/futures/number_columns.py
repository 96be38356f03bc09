"""The numbers of S futures as arrays, each applied to the quantity that the table says."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from foretwin.contracts.arrays import Array, Indices
from foretwin.contracts.future_numbers import changed_numbers
from foretwin.contracts.futures import Future
from foretwin.contracts.numbers import FUTURE_NUMBERS, Quantity
from foretwin.geometry.frenet_path import FrenetPoint
from foretwin.sim_worker.planner_interface import PlannerOutput


class Belief(NamedTuple):
    """Where S planners take their cars to be: states (S, 8), offset from the path (S,)."""

    states: Array
    offset_m: Array


class NumberColumns:
    """The numbers of S futures by name, each (S,)."""

    def __init__(self, columns: Mapping[str, Array]) -> None:
        self._columns = columns
        self._rows: dict[str, list[tuple[bool, Array]]] = {}
        changed = set()
        for name, row in FUTURE_NUMBERS.items():
            column = columns[name]
            self._rows.setdefault(row.acts_on, []).append((row.operation == "multiply", column))
            if (column != row.neutral).any():
                changed.add(row.acts_on.split(".")[0])
        self._spoils_commands = "command" in changed
        self._spoils_belief = "belief" in changed
        self.count = len(column)

    def of(self, futures: Indices) -> NumberColumns:
        """Return the numbers of (K,) of these futures."""
        return NumberColumns({name: column[futures] for name, column in self._columns.items()})

    def applied(self, quantity: Quantity, base: Array | float) -> Array:
        """Return what becomes of a quantity (S,), or one for all, by what acts on it."""
        value = np.asarray(base)
        if not value.ndim:
            value = np.broadcast_to(value, self.count)
        for multiplies, column in self._rows.get(quantity, ()):
            value = value * column if multiplies else value + column
        return value

    def factor(self, quantity: Quantity) -> Array:
        """Return (S,) what a quantity is multiplied by, leaving out what is added."""
        value = np.ones(self.count)
        for multiplies, column in self._rows.get(quantity, ()):
            value = value * column if multiplies else value
        return value

    def spoil(self, commands: PlannerOutput) -> tuple[Array, Array]:
        """Return acceleration and tyre angle (S,) as faulty actuators carry them out."""
        accel, angle = commands
        if not self._spoils_commands:
            return accel, angle
        accel = self.applied("command.accel_mps2", accel)
        accel = np.where(accel < 0.0, self.applied("command.brake_mps2", accel), accel)
        return accel, self.applied("command.tire_angle_rad", angle)

    def believed(self, states: Array, place: FrenetPoint) -> Belief:
        """Return what planners believe of their own place, given the truth."""
        if not self._spoils_belief:
            return Belief(states, place.offset_m)
        aside = self.applied("belief.offset_m", 0.0)
        shifted = states.copy()
        shifted[:, 0] -= np.sin(states[:, 2]) * aside
        shifted[:, 1] += np.cos(states[:, 2]) * aside
        return Belief(shifted, place.offset_m + aside)


def number_columns(futures: Sequence[Future]) -> NumberColumns:
    """Lay the numbers of S futures out; raises ValueError for one that the table lacks."""
    columns = {name: np.full(len(futures), row.neutral) for name, row in FUTURE_NUMBERS.items()}
    for place, future in enumerate(futures):
        for name, value in changed_numbers(future).items():
            columns[name][place] = value
    return NumberColumns(columns)
