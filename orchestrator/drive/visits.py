"""The junctions of a drive: when each World was asked for, ready, needed, and the car there."""

from __future__ import annotations

from collections import OrderedDict
from dataclasses import dataclass
from typing import Any, NamedTuple

from foretwin.contracts.running import MOST_LISTED, FirstOf
from foretwin.contracts.world import World
from foretwin.orchestrator.record.visited import RoundsOf, Visited
from foretwin.sim_worker.futures.columns import row_of
from foretwin.world_gen.junctions.intersections import Junction

MOST_JUNCTIONS, SEEN_LATELY_S = 64, 120.0
"""So many junctions, and all that were seen so lately, keep their Worlds."""
_NONE = RoundsOf()


class Moment(NamedTuple):
    """An instant by our monotonic clock, and by the drive's."""

    mono_s: float
    drive_time_s: float


@dataclass(slots=True)
class Visit:
    """One passage of a junction; `entered` is when the way to its centre fell below the radius."""

    junction: Junction
    load: bool
    """Whether the workers load its World, rather than its being built for a turn not expected."""
    seen: Moment
    world: World | None = None
    failed: bool = False
    ready: Moment | None = None
    entered: Moment | None = None
    arrived: Moment | None = None
    counted: RoundsOf = _NONE
    seen_s: float = 0.0
    """Drive time when the junction was last ahead."""

    def record(self, *, mono_s: float) -> dict[str, Any]:
        """Return the entry of run.json; a World that never came is late by all the time since."""
        return {**self._told(mono_s=mono_s), **self.counted._asdict()}

    def row(self, *, mono_s: float) -> dict[str, Any]:
        """Return the row of the table `junctions`, as far as is known."""
        return {**self._told(mono_s=mono_s), "seen_at_s": _drive_s(self.seen)}

    def _told(self, *, mono_s: float) -> dict[str, Any]:
        summary = self.junction.summary
        entered_s = mono_s if self.entered is None else self.entered.mono_s
        ready_s = max(mono_s, entered_s) if self.ready is None else self.ready.mono_s
        return {
            **row_of(summary, "id kind name control lat lon"),
            "arrived_at_s": _drive_s(self.arrived),
            "built_at_s": _drive_s(self.ready),
            "within_radius_at_s": _drive_s(self.entered),
            "world_ready_before_s": round(entered_s - ready_s, 3),
        }


class VisitBook:
    """All visits of a drive; a junction passed twice has two, the later one counts."""

    def __init__(self) -> None:
        self._latest: OrderedDict[str, Visit] = OrderedDict()
        """By junction, the one seen last at the end."""
        self.arrived: FirstOf[Visit] = FirstOf(MOST_LISTED)
        self._news: list[Visit] = []
        self._earlier: list[dict[str, Any]] = []
        """Records of passages that another book held."""
        self._open: dict[str, RoundsOf] = {}
        """Rounds of junctions, by id, since their last passage."""
        self._now = ""
        """The junction of the rounds on end that are counted now,"""
        self._behind: Visit | None = None
        """its passage that was made meanwhile, whose they are unless one more is."""

    def go_on(self, earlier: Visited) -> None:
        """Begin with what another book of the same drive held."""
        self._earlier, self._open = earlier.records, dict(earlier.ahead)

    def records(self, *, mono_s: float) -> FirstOf[dict[str, Any]]:
        """Return the `intersections` of run.json: those that the car reached, in order."""
        listed: FirstOf[dict[str, Any]] = FirstOf(MOST_LISTED)
        listed.extend(self._earlier)
        listed.extend(one.record(mono_s=mono_s) for one in self.arrived)
        listed.left_out += self.arrived.left_out
        # Until another passage comes, rounds are of the last one; one that is not listed has them.
        rest = {} if listed.left_out else dict(self._open)
        for place, one in reversed(list(enumerate(listed))):
            if (more := rest.pop(one["id"], None)) is not None:
                counted = RoundsOf(one["rounds"], one["futures"]).plus(more)
                listed[place] = {**one, **counted._asdict()}
        return listed

    def take_news(self) -> list[Visit]:
        """Return visits that are there, or have their World, since the last call."""
        news, self._news = self._news, []
        return news

    def get(self, junction_id: str) -> Visit | None:
        """Return the latest visit of a junction, None where it was never seen."""
        return self._latest.get(junction_id)

    def name_of(self, junction_id: str) -> str:
        """Return a junction that was ahead by the streets that meet there, else by its id."""
        visit = self.get(junction_id)
        return junction_id if visit is None else visit.junction.summary.name or junction_id

    def latest(self, junction_id: str) -> Visit:
        """Return the latest visit of a junction; raises KeyError where it was never seen."""
        return self._latest[junction_id]

    def enter(self, junction_id: str, at: Moment) -> None:
        """The way to the junction's centre is below the radius; the first time counts."""
        visit = self._latest.get(junction_id)
        if visit is not None and visit.arrived is None:
            visit.entered = visit.entered or at

    def see(self, junction: Junction, at: Moment, *, load: bool) -> bool:
        """Note a junction ahead; returns whether its World must be built or loaded.

        After a passage the next one begins with the World that is there already, or with the word
        that there will be none.
        """
        before = self._latest.get(junction.summary.id)
        if before is not None:
            before.seen_s = at.drive_time_s
            self._latest.move_to_end(junction.summary.id)
        if before is not None and before.arrived is None:
            more = load and not before.load
            before.load = before.load or load
            return more
        visit = Visit(junction, load, at, seen_s=at.drive_time_s)
        self._latest[junction.summary.id] = visit
        if before is None:
            self._forget(before_s=at.drive_time_s - SEEN_LATELY_S)
            return True
        if before.failed:
            visit.failed = True
            return False
        if before.world is None:
            return load and not before.load  # asked for, and still on its way
        visit.world, visit.ready = before.world, at
        before.world = None
        return load

    def _forget(self, *, before_s: float) -> None:
        """Forget the junctions not seen for longest: they are as new where they are seen again."""
        while len(self._latest) > MOST_JUNCTIONS:
            junction_id, oldest = next(iter(self._latest.items()))
            if oldest.seen_s > before_s:
                return
            oldest.world = None
            del self._latest[junction_id]
            self._open.pop(junction_id, None)

    def take_world(self, junction_id: str, world: World, at: Moment) -> None:
        """A junction's World is ready, for every visit that has waited for it."""
        late = [visit for visit in self.arrived if visit.junction.summary.id == junction_id]
        latest = self._latest.get(junction_id)
        for visit in [*late, *([latest] if latest else [])]:
            if visit.ready is None:
                visit.ready = at
                self._news += [visit] if visit.arrived is not None else []
        if latest is not None:
            latest.world = latest.world or world

    def fail(self, junction_id: str) -> None:
        """A junction's World cannot be built."""
        if (visit := self._latest.get(junction_id)) is not None:
            visit.failed = True

    def count_round(self, junction_id: str, *, futures: int) -> None:
        """A round for a junction is complete; it is of the passage that `by_passage` says."""
        if junction_id != self._now:
            if self._behind is not None:
                self._behind.counted = self._behind.counted.plus(self._open.pop(self._now, _NONE))
            self._now, self._behind = junction_id, None
        self._open[junction_id] = self._open.get(junction_id, _NONE).plus(RoundsOf(1, futures))

    def arrive(self, junction_id: str, at: Moment) -> None:
        """The car is at the junction's centre."""
        visit = self._latest[junction_id]
        visit.arrived, visit.entered = at, visit.entered or at
        visit.counted = visit.counted.plus(self._open.pop(junction_id, _NONE))
        if junction_id == self._now:
            self._behind = visit
        self.arrived.append(visit)
        self._news.append(visit)


def _drive_s(at: Moment | None) -> float | None:
    return None if at is None else round(at.drive_time_s, 3)
