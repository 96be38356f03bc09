"""The verdict on vehicles that meet in the World: rows of its table, and touches as they happen."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import msgspec

from foretwin.contracts.drive import VehicleState
from foretwin.contracts.roles import OtherVehicle, Role, VehicleEncounter
from foretwin.orchestrator.instructions import Notice
from foretwin.orchestrator.other_vehicles.encounters import EncounterWatch
from foretwin.orchestrator.plan import DrivePlan
from foretwin.orchestrator.record.results import ResultTables
from foretwin.sim_worker.futures.columns import row_of

_STEP_BACK_NS = 1_000_000_000
"""Of the car's clock: what was measured before it says nothing any more."""


@dataclass(slots=True)
class EncounterCount:
    """What run.json says of them."""

    met: int = 0
    touched: int = 0
    nearest: VehicleEncounter | None = None

    def take(self, encounter: VehicleEncounter) -> None:
        """Count one that is over."""
        self.met += 1
        self.touched += encounter.touched
        if self.nearest is None or encounter.least_m < self.nearest.least_m:
            self.nearest = encounter

    def record(self) -> dict[str, Any]:
        """Return the `encounters` of run.json."""
        nearest = None if self.nearest is None else msgspec.to_builtins(self.nearest)
        return {"met": self.met, "touched": self.touched, "nearest": nearest}


class EncounterHandler:
    """Judges the car and the vehicles beside it; without any beside it, nothing."""

    def __init__(
        self, plan: DrivePlan, tables: ResultTables, tell: Callable[[Notice], None]
    ) -> None:
        self._plan, self._tables, self._tell = plan, tables, tell
        self._own = plan.config.vehicle_id
        self._watch = self._new_watch()
        self._told: set[tuple[str, str]] = set()
        self._last_ns = 0
        self.count = EncounterCount()

    def _new_watch(self) -> EncounterWatch:
        vehicles = {one.config.id: one.vehicle for one in self._plan.beside}
        return EncounterWatch({self._own: self._plan.vehicle, **vehicles}, self._plan.drive_frame)

    def keep_up_with(
        self, own: VehicleState, heard: Sequence[OtherVehicle], roles: Mapping[str, Role]
    ) -> None:
        """Take the car's new state and what is new of the others; ghosts meet nobody."""
        if not self._plan.beside or not own.yaw_valid:
            return
        if own.stamp_ns < self._last_ns - _STEP_BACK_NS:
            self._end(self._watch.finish())
            self._watch = self._new_watch()
        self._last_ns = own.stamp_ns
        self._watch.take(own)
        for one in heard:
            self._watch.take(one.state, clock_std_s=one.clock_std_s)
        ghosts = [name for name, role in roles.items() if role == "ghost"]
        over = self._watch.judge(own.stamp_ns, apart=ghosts)
        for encounter in (*self._watch.open, *over):
            self._tell_touch(encounter)
        self._end(over)

    def finish(self) -> None:
        """End what is still open; idempotent."""
        self._end(self._watch.finish())

    def _tell_touch(self, encounter: VehicleEncounter) -> None:
        pair = encounter.one, encounter.other
        if encounter.touched and pair not in self._told:
            self._told.add(pair)
            ago_s = (self._last_ns - encounter.least_stamp_ns) / 1e9
            text = f"{pair[0]} and {pair[1]} touch in the World, as measured {ago_s:.2f} s ago"
            self._tell(Notice("warning", text))

    def _end(self, encounters: Sequence[VehicleEncounter]) -> None:
        for encounter in encounters:
            self._told.discard((encounter.one, encounter.other))
            self.count.take(encounter)
            if not encounter.touched:
                text = (
                    f"{encounter.one} and {encounter.other} met in the World: "
                    f"{encounter.least_m:.2f} m ± {encounter.uncertain_m:.2f} m between them"
                )
                self._tell(Notice("info", text))
        if encounters:
            self._tables.add("encounters", [row_of(one) for one in encounters])
