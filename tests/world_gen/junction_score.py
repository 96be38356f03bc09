"""How well a World of a drawn junction agrees with the truth about it."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field

import numpy as np

from foretwin.contracts.world import Connection, Lane, World, WorldJunction
from tests.world_gen.truth_sheet import TrueJunction

COLUMNS = ("kind", "control", "arms", "lanes", "movements", "turns", "ring", "yields")


@dataclass(slots=True)
class Score:
    """Right answers out of all by subject, and every miss in words."""

    right: dict[str, int] = field(default_factory=lambda: dict.fromkeys(COLUMNS, 0))
    asked: dict[str, int] = field(default_factory=lambda: dict.fromkeys(COLUMNS, 0))
    misses: list[str] = field(default_factory=list)
    unlisted: list[str] = field(default_factory=list)
    """Pairs of movements that only the World or only the truth calls conflicting."""

    def ask(self, column: str, right: bool, miss: str) -> None:
        """Count one question, and keep the miss where the answer is wrong."""
        self.asked[column] += 1
        self.right[column] += right
        if not right:
            self.misses.append(f"{column}: {miss}")

    def add(self, other: Score) -> None:
        """Add another score's counts and words to this one."""
        for column in COLUMNS:
            self.right[column] += other.right[column]
            self.asked[column] += other.asked[column]
        self.misses += other.misses
        self.unlisted += other.unlisted

    def share(self, column: str) -> float:
        """Return the part of right answers, 1 where nothing was asked."""
        return self.right[column] / self.asked[column] if self.asked[column] else 1.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Seen:
    """What a World shows of one junction, by the truth's arm letters."""

    letter_of: Mapping[str, str]
    lanes: Mapping[str, Lane]
    inside: frozenset[str]
    """Lanes from one place of the junction to another: of a ring, of a flare."""
    connections: Mapping[str, Connection]
    movements_of: Mapping[str, frozenset[str]]
    """The movements that lead over each connection, by its id."""
    turns: Mapping[str, frozenset[str]]
    """Turns of each movement that is one connection long; empty where it is longer."""


def score(truth: TrueJunction, world: World, junction: WorldJunction) -> Score:
    """Compare one junction of a World with the truth."""
    result = Score()
    summary = junction.summary
    if truth.kind:
        result.ask("kind", summary.kind == truth.kind, f"{summary.kind}, not {truth.kind}")
    if truth.control:
        result.ask(
            "control", summary.control == truth.control, f"{summary.control}, not {truth.control}"
        )
    seen = _see(truth, world, junction)
    _score_arms(truth, junction, result)
    _score_lanes(truth, world, seen, result)
    _score_movements(truth, seen, result)
    if truth.ring:
        _score_ring(truth, world, seen, result)
    if truth.entry_waits:
        _score_entries(truth, world, seen, result)
    else:
        _score_yields(truth, world, seen, result)
    return result


def _see(truth: TrueJunction, world: World, junction: WorldJunction) -> Seen:
    letter_of = {arm.road: letter for letter, arm in truth.arms.items()}
    lanes = {lane.id: lane for lane in world.lanes}
    connections = {c.id: c for c in world.connections if c.junction_id == junction.summary.id}
    places = {c.place_id for c in connections.values()}
    between = {
        road.id for road in world.roads if road.from_place in places and road.to_place in places
    }
    inside = frozenset(lane.id for lane in world.lanes if lane.road_id in between)
    onward: dict[str, list[Connection]] = defaultdict(list)
    for c in connections.values():
        onward[c.from_lane_id].append(c)
    movements_of: dict[str, set[str]] = {key: set() for key in connections}
    turns: dict[str, set[str]] = defaultdict(set)
    for c in connections.values():
        first = lanes[c.from_lane_id]
        if first.kind != "driving" or first.id in inside:
            continue
        for path in _paths([c], onward, inside):
            last = lanes[path[-1].to_lane_id]
            if last.kind == "driving":
                start = letter_of.get(first.name, first.name or "?")
                end = letter_of.get(last.name, last.name or "?")
                turns[f"{start}>{end}"] |= {c.turn} if len(path) == 1 else set()
                for passed in path:
                    movements_of[passed.id].add(f"{start}>{end}")
    return Seen(
        letter_of=letter_of,
        lanes=lanes,
        inside=inside,
        connections=connections,
        movements_of={key: frozenset(found) for key, found in movements_of.items()},
        turns={key: frozenset(found) for key, found in turns.items()},
    )


def _paths(
    path: list[Connection], onward: Mapping[str, list[Connection]], inside: frozenset[str]
) -> Iterator[list[Connection]]:
    """Yield the ways on through the junction, each lane in it once, to the lanes that leave it."""
    end = path[-1].to_lane_id
    if end not in inside:
        yield path
        return
    passed = {c.from_lane_id for c in path}
    for c in onward.get(end, ()):
        if c.from_lane_id not in passed:
            yield from _paths([*path, c], onward, inside)


def _score_arms(truth: TrueJunction, junction: WorldJunction, result: Score) -> None:
    found = [arm.name for arm in junction.arms]
    for arm in truth.arms.values():
        times = found.count(arm.road)
        result.ask("arms", times == 1, f"{arm.road} is there {times} times")
    roads = {arm.road for arm in truth.arms.values()}
    for name in found:
        if name not in roads:
            result.ask("arms", False, f"invented {name or 'a nameless arm'}")


def _score_lanes(truth: TrueJunction, world: World, seen: Seen, result: Score) -> None:
    places = {c.place_id for c in seen.connections.values()}
    roads = {road.id: road for road in world.roads}
    found: dict[tuple[str, str, str], int] = defaultdict(int)
    for lane in world.lanes:
        road = roads[lane.road_id]
        ends = (road.to_place, road.from_place)
        there, back = ends[::-1] if lane.reverse else ends
        # A lane from which both directions turn counts for neither, though it is driven one way.
        if lane.id not in seen.inside and not lane.id.endswith(".centre"):
            found[lane.name, lane.kind, "in"] += there in places
            found[lane.name, lane.kind, "out"] += back in places
    for arm in truth.arms.values():
        asked = [
            ("driving", "in", arm.lanes_in),
            ("driving", "out", arm.lanes_out),
            ("bus", "in", arm.bus_in),
            ("bus", "out", arm.bus_out),
        ]
        for kind, way, lanes in asked:
            have = found[arm.road, kind, way]
            if kind == "driving" or lanes or have:
                words = f"{arm.road} has {have} {kind} lanes {way}, not {lanes}"
                result.ask("lanes", have == lanes, words)


def _score_movements(truth: TrueJunction, seen: Seen, result: Score) -> None:
    for movement, turn in truth.turns.items():
        have = seen.turns.get(movement)
        result.ask("movements", have is not None, f"missed {movement}")
        if have and turn:
            result.ask("turns", have == {turn}, f"{movement} is {', '.join(have)}, not {turn}")
    for movement in sorted(seen.turns.keys() - truth.turns.keys() - truth.open):
        result.ask("movements", False, f"invented {movement}")
    for c in seen.connections.values():
        first, last = seen.lanes[c.from_lane_id], seen.lanes[c.to_lane_id]
        if {first.id, last.id} <= seen.inside and (first.role, last.role) == ("exit", "approach"):
            result.ask("movements", False, f"turns back from an exit into an entry, {first.name}")


def _score_ring(truth: TrueJunction, world: World, seen: Seen, result: Score) -> None:
    side = world.junctions[0].summary.driving_side
    way = "clockwise" if side == "left" else "counter-clockwise"
    ring = [lane for lane in seen.lanes.values() if lane.role == "ring"]
    if ring:
        middle = np.mean(np.vstack([lane.centerline for lane in ring]), axis=0)
        turned = []
        for lane in ring:
            a, b = lane.centerline[:-1] - middle, np.diff(lane.centerline, axis=0)
            turned.append(float((a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]).sum()))
        ways = {"counter-clockwise" if area > 0 else "clockwise" for area in turned}
        way = ways.pop() if len(ways) == 1 else "both ways"
    elif truth.kind != "mini_roundabout":
        way = "without a ring lane"
    result.ask("ring", way == truth.ring, f"the ring runs {way}, not {truth.ring}")


def _score_entries(truth: TrueJunction, world: World, seen: Seen, result: Score) -> None:
    """Ask at each arm whether who enters waits for the ring, at every meeting of the two."""
    answers: dict[str, list[bool]] = defaultdict(list)
    for conflict in world.conflicts:
        pair = [seen.connections.get(key) for key in (conflict.first_id, conflict.second_id)]
        for entry, other in (pair, pair[::-1]):
            if entry is None or other is None:
                continue
            first = seen.lanes[entry.from_lane_id]
            if first.role != "ring" and seen.lanes[other.from_lane_id].role == "ring":
                letter = seen.letter_of.get(first.name, first.name)
                answers[letter].append(conflict.yields_id == entry.id)
    for letter, waits in truth.entry_waits.items():
        have = answers.get(letter, [])
        words = "the ring waits" if waits else "who enters waits"
        what = f"{letter}: {words} {have.count(not waits)} of {len(have)} times"
        result.ask("yields", bool(have) and all(answer == waits for answer in have), what)


def _score_yields(truth: TrueJunction, world: World, seen: Seen, result: Score) -> None:
    answers: dict[frozenset[str], set[str]] = defaultdict(set)
    rules: dict[frozenset[str], set[str]] = defaultdict(set)
    for conflict in world.conflicts:
        if conflict.first_id not in seen.connections or conflict.second_id not in seen.connections:
            continue
        for first in seen.movements_of[conflict.first_id]:
            for second in seen.movements_of[conflict.second_id]:
                if first != second:
                    waits = first if conflict.yields_id == conflict.first_id else second
                    answers[frozenset((first, second))].add(waits)
                    rules[frozenset((first, second))].add(conflict.rule)
    for pair, waiting in truth.waiting.items():
        have = answers.get(pair)
        words = " & ".join(sorted(pair))
        if have is None:
            if pair <= seen.turns.keys():
                result.unlisted.append(f"{words} (truth)")
            continue
        rule = ", ".join(sorted(rules[pair]))
        what = f"{words}: {', '.join(sorted(have))} waits ({rule}), not {', '.join(waiting)}"
        result.ask("yields", have <= waiting, what)
    for pair in sorted(answers.keys() - truth.waiting.keys(), key=sorted):
        if not pair & truth.open and pair <= truth.turns.keys():
            result.unlisted.append(f"{' & '.join(sorted(pair))} (World)")
