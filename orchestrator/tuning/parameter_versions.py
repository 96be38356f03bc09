"""Which of a vehicle's parameters count, since when, and which processes have them.

Pure but for `ask`: changes wait until no round is open, so that each round has one set throughout.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Any, NamedTuple

import msgspec

from foretwin.contracts.running import MOST_LISTED, FirstOf
from foretwin.contracts.tuning import (
    Identification,
    ParameterChange,
    ParameterEstimate,
    UseVehicle,
)
from foretwin.contracts.vehicle import VehicleParameters
from foretwin.orchestrator.record.results import PARAMETER
from foretwin.sim_worker.analysis.identify.acceptance import in_force, is_acceptable
from foretwin.sim_worker.analysis.identify.parameters_in_force import ParametersInForce
from foretwin.sim_worker.futures.columns import row_of

_BY_HAND = ("set", "rolled_back")


class ParametersStanding(NamedTuple):
    """What counts in a drive, for one that goes on with it."""

    in_force: ParametersInForce
    version: int
    made: FirstOf[ParameterChange]
    pinned: frozenset[str]
    stamp_ns: int


class ParameterVersions:
    """Holds the parameters of one drive; `ask` sends a UseVehicle to a process.

    Every process that was asked answers once by `answered`; no round may start before.
    """

    def __init__(
        self,
        vehicle: VehicleParameters,
        *,
        vehicle_id: str,
        ask: Callable[[str, UseVehicle], None],
    ) -> None:
        self.in_force = ParametersInForce(vehicle=vehicle, vehicle_id=vehicle_id)
        self.version = 0
        self.made: FirstOf[ParameterChange] = FirstOf(MOST_LISTED)
        """The changes of the drive, in order."""
        self._last: dict[str, ParameterChange] = {}
        self._ask = ask
        self._waiting: list[ParameterChange] = []
        self._pinned: frozenset[str] = frozenset()
        self._awaited: set[str] = set()
        self._stamp_ns = 0

    @property
    def standing(self) -> ParametersStanding:
        """What processes have been told; what still waits is not of it."""
        return ParametersStanding(
            self.in_force, self.version, self.made, self._pinned, self._stamp_ns
        )

    def go_on(self, standing: ParametersStanding) -> None:
        """Begin with what counted before; every process is told as it comes up."""
        self.in_force, self.version, self.made, self._pinned, self._stamp_ns = standing

    @property
    def settled(self) -> bool:
        """Whether every process has what counts."""
        return not self._awaited

    @property
    def waiting(self) -> bool:
        """Whether something counts that no process has been told yet."""
        return bool(self._waiting) or self._pinned != self.in_force.pinned

    def apply(self, told: Identification) -> None:
        """Let what was identified count.

        A value in force that lies within the interval found stays: the driving does not say that
        another is better, and every change is one more version to explain.
        """
        vehicle = self.in_force.vehicle
        news = tuple(one for one in told.estimates if departs(one, in_force(vehicle, one.name)))
        self.note(self.in_force.take(msgspec.structs.replace(told, estimates=news)))

    def note(self, changes: Iterable[ParameterChange]) -> None:
        """Hand these changes of `in_force` over when `hand_over` is called next."""
        self._waiting += changes

    def hand_over(
        self, processes: Iterable[str], *, watcher: str, stamp_ns: int
    ) -> tuple[ParameterChange, ...]:
        """Tell the processes what counts from `stamp_ns` on; returns what has changed.

        Pins alone concern the `watcher`, who identifies.
        """
        if not self.waiting:
            return ()
        changes = tuple(
            msgspec.structs.replace(one, stamp_ns=stamp_ns, pinned=one.name in self.in_force.pinned)
            for one in self._waiting
        )
        self._waiting, self._pinned = [], frozenset(self.in_force.pinned)
        if changes:
            self.version += 1
            self._stamp_ns = stamp_ns
            self.made.extend(changes)
            self._last |= {one.name: one for one in changes}
        for process_id in processes:
            if changes or process_id == watcher:
                self._tell(process_id, changes)
        return changes

    def tell(self, process_id: str) -> bool:
        """Tell a process that has come up; returns whether it has something to learn."""
        if not self.version and not self._pinned:
            return False
        by_hand = tuple(one for one in self._last.values() if one.origin in _BY_HAND)
        self._tell(process_id, by_hand)
        return True

    def _tell(self, process_id: str, changes: tuple[ParameterChange, ...]) -> None:
        self._awaited.add(process_id)
        self._ask(
            process_id,
            UseVehicle(
                stamp_ns=self._stamp_ns,
                vehicle=self.in_force.vehicle,
                version=self.version,
                changes=changes,
                pinned=tuple(sorted(self._pinned)),
            ),
        )

    def answered(self, process_id: str) -> None:
        """A process has what counts, or is gone."""
        self._awaited.discard(process_id)

    def rows(self) -> list[dict[str, Any]]:
        """Return the changes as run.json has them."""
        return [msgspec.to_builtins(one) for one in self.made]


def departs(found: ParameterEstimate, counts: float) -> bool:
    """Return whether the driving says for sure that a value that counts is another."""
    if not is_acceptable(found):
        return False
    assert found.low is not None
    assert found.high is not None
    return not found.low <= counts <= found.high


def change_row(change: ParameterChange, *, version: int) -> dict[str, Any]:
    """Return the row of the table `parameters`."""
    return {"version": version, **row_of(change, PARAMETER)}


def change_text(change: ParameterChange) -> str:
    """Return a change in the engineer's words."""
    by_hand = {"set": "set by hand", "rolled_back": "rolled back"}
    found = {"identified": "as the driving says", "file": "of the vehicle file"}
    how = (by_hand | found)[change.origin]
    spread = "" if change.std is None else f" ± {1.96 * change.std:.2g}"
    return f"{change.name} {change.before:.5g} -> {change.value:.5g}{spread}, {how}"
