"""Free runs made once: those that are known are not run again, and unsettled ones are."""

from __future__ import annotations

import numpy as np

from foretwin.contracts.arrays import Array, Indices
from foretwin.sim_worker.analysis.gap.free_run import RunMemory


class Runs:
    """Asks a memory for runs, and counts those that had to be made."""

    def __init__(self) -> None:
        self.made: list[int] = []
        self._memory = RunMemory()

    def ask(self, stamps: list[int], held: list[bool], settled: list[bool]) -> Array:
        def run(rows: Indices) -> Array:
            self.made += [stamps[row] for row in rows]
            began = np.array([[stamps[row], held[row]] for row in rows], dtype=np.float64)
            return np.repeat(began[:, None], 3, axis=1)

        return self._memory.states(
            stamp_ns=np.array(stamps),
            held=np.array(held),
            settled=np.array(settled),
            from_stamp_ns=stamps[0],
            run=run,
        )


def test_runs_come_in_the_order_asked_for_and_settled_ones_are_made_once() -> None:
    runs = Runs()
    first = runs.ask([10, 20, 30], [False, False, False], [True, True, False])
    assert runs.made == [10, 20, 30]
    again = runs.ask([20, 30, 40], [False, False, False], [True, True, False])
    assert runs.made == [10, 20, 30, 30, 40], "30 had not settled"
    assert first[:, 0, 0].tolist() == [10.0, 20.0, 30.0]
    assert again[:, 0, 0].tolist() == [20.0, 30.0, 40.0]
    runs.ask([20, 30, 40], [False, False, False], [True, True, True])
    assert runs.made[5:] == [40]


def test_both_kinds_of_a_run_are_known_apart() -> None:
    runs = Runs()
    runs.ask([10], [True], [True])
    both = runs.ask([10, 10], [True, False], [True, True])
    assert runs.made == [10, 10]
    assert both[:, 0, 1].tolist() == [1.0, 0.0]


def test_what_is_older_than_the_stretch_is_forgotten() -> None:
    runs = Runs()
    runs.ask([10, 20], [False, False], [True, True])
    runs.ask([20, 30], [False, False], [True, True])
    runs.ask([10, 20], [False, False], [True, True])
    assert runs.made == [10, 20, 30, 10]
