"""The junctions of a drive: when each World was asked for, ready, needed, and the car there."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from foretwin.contracts.world import World
from foretwin.world_gen.junctions.intersections import Junction


@dataclass(slots=True)
class Visit:
    """One passage of a junction; `entered` is when the way to its centre fell below the radius."""

    junction: Junction
    load: bool
    """Whether the workers load its World, rather than its being built for a turn not expected."""
    world: World | None = None
    failed: bool = False
    ready_mono_s: float | None = None
    built_at_s: float | None = None
    entered_mono_s: float | None = None
    entered_at_s: float | None = None
    arrived_at_s: float | None = None
    rounds: int = 0
    futures: int = 0

    def enter(self, *, mono_s: float, drive_time_s: float) -> None:
        """The car is within the junction's radius; the first time counts."""
        if self.entered_mono_s is None:
            self.entered_mono_s, self.entered_at_s = mono_s, drive_time_s

    def take_world(self, world: World, *, mono_s: float, drive_time_s: float) -> None:
        """The World is ready."""
        self.world, self.ready_mono_s, self.built_at_s = world, mono_s, drive_time_s

    def record(self, *, mono_s: float) -> dict[str, Any]:
        """Return the entry of run.json; a World that never came is late by all the time since."""
        summary = self.junction.summary
        entered = mono_s if self.entered_mono_s is None else self.entered_mono_s
        ready = max(mono_s, entered) if self.ready_mono_s is None else self.ready_mono_s
        return {
            "id": summary.id,
            "kind": summary.kind,
            "name": summary.name,
            "control": summary.control,
            "lat": summary.lat,
            "lon": summary.lon,
            "arrived_at_s": _rounded(self.arrived_at_s),
            "built_at_s": _rounded(self.built_at_s),
            "within_radius_at_s": _rounded(self.entered_at_s),
            "world_ready_before_s": round(entered - ready, 3),
            "rounds": self.rounds,
            "futures": self.futures,
        }


class VisitBook:
    """All visits of a drive; a junction passed twice has two, the later one counts."""

    def __init__(self) -> None:
        self._latest: dict[str, Visit] = {}
        self.arrived: list[Visit] = []

    def get(self, junction_id: str) -> Visit | None:
        """Return the latest visit of a junction, None where it was never seen."""
        return self._latest.get(junction_id)

    def latest(self, junction_id: str) -> Visit:
        """Return the latest visit of a junction; raises KeyError where it was never seen."""
        return self._latest[junction_id]

    def enter(self, junction_id: str, *, mono_s: float, drive_time_s: float) -> None:
        """The way to the junction's centre is below the radius; the first time counts."""
        visit = self._latest.get(junction_id)
        if visit is not None and visit.arrived_at_s is None:
            visit.enter(mono_s=mono_s, drive_time_s=drive_time_s)

    def see(self, junction: Junction, *, load: bool, mono_s: float, drive_time_s: float) -> bool:
        """Note a junction ahead; returns whether its World must be built or loaded.

        After a passage the next one begins with the World that is there already, or with the word
        that there will be none.
        """
        before = self._latest.get(junction.summary.id)
        if before is not None and before.arrived_at_s is None:
            more = load and not before.load
            before.load = before.load or load
            return more
        visit = Visit(junction, load)
        self._latest[junction.summary.id] = visit
        if before is None:
            return True
        if before.failed:
            visit.failed = True
            return False
        if before.world is None:
            return load and not before.load  # asked for, and still on its way
        visit.take_world(before.world, mono_s=mono_s, drive_time_s=drive_time_s)
        return load

    def take_world(
        self, junction_id: str, world: World, *, mono_s: float, drive_time_s: float
    ) -> None:
        """A junction's World is ready, for every visit that has waited for it."""
        late = [visit for visit in self.arrived if visit.junction.summary.id == junction_id]
        for visit in [*late, self._latest[junction_id]]:
            if visit.world is None:
                visit.take_world(world, mono_s=mono_s, drive_time_s=drive_time_s)

    def arrive(self, junction_id: str, *, mono_s: float, drive_time_s: float) -> Visit:
        """The car is at the junction's centre."""
        visit = self._latest[junction_id]
        visit.arrived_at_s = drive_time_s
        visit.enter(mono_s=mono_s, drive_time_s=drive_time_s)
        self.arrived.append(visit)
        return visit


def _rounded(value: float | None) -> float | None:
    return None if value is None else round(value, 3)
