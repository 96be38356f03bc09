"""Where scenarios apply, counted from a raw map: plain junctions and rings, nothing of foretwin.

Counted is what nobody would doubt: junctions of three or four roads at clear angles with no other
one near them, without turn restrictions or lanes marked for turns, with roads long enough and free
of buildings, on which the slowest case of a scenario keeps the limit.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
import shapely

from tests.placed.raw_map import Plane, RawMap, RawRoad

STRAIGHT_DEG, SIDE_DEG = 20.0, (65.0, 115.0)
ALONE_M, REACH_M = 25.0, 70.0
LEAST_EXIT_M = 15.0
BESIDE_DEG, FORK_DEG = 90.0, 30.0
RUN_UP_S = 2.5
EGO_OVER, OTHER_OVER = 1.1, 1.5
HALF_ROAD_M = 3.5
UNTAGGED_KMH = {"living_street": 7.0, "residential": 30.0}
"""Limits where a way has none; other roads in towns are good for 40 km/h in all countries here."""


class Wanted(NamedTuple):
    """What a scenario needs at a junction, with the speeds (km/h) of its slowest case."""

    turn: str
    ego_kmh: float
    other: str = ""
    other_turn: str = ""
    other_kmh: float = 0.0
    arms: int = 3
    lights: bool = False
    on_foot: bool = False


WANTED = {
    "cccscp": Wanted("straight", 20, "near", "straight", 20, arms=4),
    "scp": Wanted("straight", 29, "across", "straight", 29, arms=4),
    "emergency_vehicle": Wanted("straight", 29, "near", "straight", 47, arms=4),
    "lost_detections": Wanted("straight", 40, "near", "straight", 40, arms=4),
    "red_light": Wanted("straight", 34, "across", "straight", 43, arms=4, lights=True),
    "ccftap": Wanted("across", 10, "oncoming", "straight", 30),
    "gnss_offset": Wanted("across", 20, "oncoming", "straight", 40),
    "ltap_od": Wanted("straight", 29, "oncoming", "across", 18),
    "ltip": Wanted("across", 14, "near", "straight", 36),
    "rtip": Wanted("near", 14, "across", "straight", 36),
    "cbta": Wanted("near", 10, on_foot=True),
    "cpta": Wanted("across", 10, on_foot=True),
    "latency": Wanted("near", 20, on_foot=True),
    "steering_fault": Wanted("across", 18),
    "lead_stopping": Wanted("straight", 50),
    "brake_fault": Wanted("straight", 40),
    "low_friction": Wanted("straight", 40),
}


class Arm(NamedTuple):
    """A road that leaves a node: its line outward in metres, and who may drive it which way."""

    bearing_deg: float
    line: shapely.LineString
    comes_in: bool
    goes_out: bool
    limit_kmh: float
    road: RawRoad


def counted(raw: RawMap) -> dict[str, set[int]]:
    """Return the nodes of junctions at which each scenario applies, by its id."""
    roads = _Roads(raw)
    found: dict[str, set[int]] = {id_: set() for id_ in WANTED}
    for node in roads.plain_junctions():
        left_hand = drives_left(*roads.places[node])
        arms = roads.arms(node)
        if _roads_of(arms) < 3:
            continue
        for id_, wanted in WANTED.items():
            if len(arms) < wanted.arms or (wanted.lights and not roads.lit(node, arms)):
                continue
            if any(roads.free(ways) for ways in _ways(wanted, arms, left_hand)):
                found[id_].add(node)
    return found


def _roads_of(arms: list[Arm]) -> int:
    """Return how many roads meet, where two carriageways of one road that lie beside each other
    are one, and so is a one-way road that forks into itself, or comes together again."""
    one_way = all(arm.comes_in != arm.goes_out for arm in arms)
    count, taken = len(arms), set[int]()
    for (i, a), (j, b) in itertools.combinations(enumerate(arms), 2):
        apart_deg = abs(_between(a.bearing_deg, b.bearing_deg))
        single = a.comes_in != a.goes_out and b.comes_in != b.goes_out
        carriageways = single and a.comes_in != b.comes_in and apart_deg < BESIDE_DEG
        forks = one_way and a.comes_in == b.comes_in and apart_deg < FORK_DEG
        if (carriageways or forks) and _called(a) == _called(b) and not {i, j} & taken:
            count -= 1
            taken |= {i, j}
    return count


def _called(arm: Arm) -> str | None:
    return arm.road.tags.get("name") or arm.road.tags.get("ref")


class Found(NamedTuple):
    """Of the nodes at which a scenario applies, those that were looked at, and those of them where
    it was placed."""

    applies: int
    placed: int
    missed: tuple[int, ...]


def found(
    counted_nodes: set[int], placed: set[int], looked_at: set[int], known: frozenset[int]
) -> Found:
    """Return how many of the counted nodes were placed; a node of no known junction is missed."""
    asked = sorted(node for node in counted_nodes if node in looked_at or node not in known)
    missed = tuple(node for node in asked if node not in placed)
    return Found(len(asked), len(asked) - len(missed), missed)


def drives_left(lon_deg: float, lat_deg: float) -> bool:
    """Return whether traffic keeps left: on the British Isles, among the maps that are read."""
    return 49.8 < lat_deg < 61.0 and -11.0 < lon_deg < 1.8


def _ways(wanted: Wanted, arms: list[Arm], left_hand: bool) -> Iterator[list[tuple[Arm, Arm]]]:
    """Yield the ways (from, to) of the ego and the other that make the scenario."""
    for ego in itertools.permutations(arms, 2):
        if _turn(*ego, left_hand) != wanted.turn or not _drivable(*ego, wanted.ego_kmh, EGO_OVER):
            continue
        if not wanted.other:
            yield [ego]
            continue
        for other in itertools.permutations(arms, 2):
            if other[0] is ego[0] or _from(ego[0], other[0], left_hand) != wanted.other:
                continue
            fits = _drivable(*other, wanted.other_kmh, OTHER_OVER)
            if fits and _turn(*other, left_hand) == wanted.other_turn:
                yield [ego, other]


def _drivable(come: Arm, go: Arm, kmh: float, over: float) -> bool:
    long_enough = come.line.length >= RUN_UP_S * kmh / 3.6 + 15.0
    long_enough = long_enough and go.line.length >= LEAST_EXIT_M
    return come.comes_in and go.goes_out and kmh <= over * come.limit_kmh and long_enough


def _turn(come: Arm, go: Arm, left_hand: bool) -> str:
    """Return how one turns from an arm into another; nothing where that is not clear."""
    turned = _between(come.bearing_deg + 180.0, go.bearing_deg)
    if abs(turned) <= STRAIGHT_DEG:
        return "straight"
    if not SIDE_DEG[0] <= abs(turned) <= SIDE_DEG[1]:
        return ""
    return "across" if (turned > 0) != left_hand else "near"


def _from(mine: Arm, theirs: Arm, left_hand: bool) -> str:
    """Return on which side of the ego's arm another lies, as the ego sees it."""
    turned = _between(mine.bearing_deg + 180.0, theirs.bearing_deg)
    if abs(turned) <= STRAIGHT_DEG:
        return "oncoming"
    if not SIDE_DEG[0] <= abs(turned) <= SIDE_DEG[1]:
        return ""
    return "across" if (turned > 0) != left_hand else "near"


def _between(a_deg: float, b_deg: float) -> float:
    return (b_deg - a_deg + 180.0) % 360.0 - 180.0


class _Roads:
    """The roads of a map as a graph of their nodes, and the buildings beside them."""

    def __init__(self, raw: RawMap) -> None:
        self._raw = raw
        self.places: dict[int, np.ndarray] = {}
        self._next: dict[int, list[tuple[int, RawRoad, int]]] = {}
        for road in raw.roads:
            self.places |= dict(zip(road.nodes, road.lon_lat, strict=True))
            for a, b in itertools.pairwise(road.nodes):
                if a != b:
                    self._next.setdefault(a, []).append((b, road, 1))
                    self._next.setdefault(b, []).append((a, road, -1))
        self._junctions = {n for n, links in self._next.items() if len(links) >= 3}
        middle = np.mean(list(self.places.values()), axis=0)
        self._plane = Plane(float(middle[1]), float(middle[0]))
        self._at = {n: self._plane.xy_m(p[None])[0] for n, p in self.places.items()}
        self._buildings = shapely.STRtree([self._plane.of(b) for b in raw.buildings])
        self._barred = {
            member[1]
            for turn in raw.no_turns
            if isinstance(member := turn.get("via"), tuple) and member[0] == "n"
        }

    def plain_junctions(self) -> Iterator[int]:
        """Yield nodes where three or four two-way or one-way roads meet, and no other near them."""
        nodes = sorted(self._junctions)
        tree = shapely.STRtree([shapely.Point(self._at[n]) for n in nodes])
        for place, node in enumerate(nodes):
            links = self._next[node]
            if len(links) > 4 or node in self._barred:
                continue
            if len(tree.query(tree.geometries[place], "dwithin", ALONE_M)) > 1:
                continue
            if all(_plain(road) for _, road, _ in links):
                yield node

    def arms(self, node: int) -> list[Arm]:
        """Return the roads that leave a node, each followed straight on."""
        return [self._arm(node, *link) for link in self._next[node]]

    def _arm(self, node: int, after: int, road: RawRoad, way: int) -> Arm:
        line, last, length = [self._at[node], self._at[after]], (node, after), 0.0
        length = float(np.hypot(*(line[1] - line[0])))
        comes_in, goes_out = road.oneway * way <= 0, road.oneway * way >= 0
        limit = _limit_kmh(road)
        while length < REACH_M:
            onward = [link for link in self._next[last[1]] if link[0] != last[0]]
            bends = [abs(_bend(line[-2], line[-1], self._at[link[0]])) for link in onward]
            if not onward or min(bends) > 45.0:
                break
            then, road_on, way_on = onward[int(np.argmin(bends))]
            if road_on.oneway * way_on != road.oneway * way or not _plain(road_on):
                break
            last = (last[1], then)
            line.append(self._at[then])
            length += float(np.hypot(*(line[-1] - line[-2])))
            if length < 40.0:
                limit = min(limit, _limit_kmh(road_on))
        whole = shapely.LineString(line)
        ahead = whole.interpolate(min(20.0, whole.length))
        x, y = ahead.x - line[0][0], ahead.y - line[0][1]
        bearing = math.degrees(math.atan2(y, x))
        return Arm(bearing, whole, comes_in, goes_out, limit, road)

    def lit(self, node: int, arms: list[Arm]) -> bool:
        """Return whether a junction has traffic lights, at its node."""
        return node in self._raw.lights

    def free(self, ways: list[tuple[Arm, Arm]]) -> bool:
        """Return whether no building stands on the roads of these ways."""
        lines = {id(arm): arm.line for way in ways for arm in way}
        ground = shapely.union_all([line.buffer(HALF_ROAD_M) for line in lines.values()])
        return len(self._buildings.query(ground, "intersects")) == 0


def _plain(road: RawRoad) -> bool:
    """Return whether a road is an ordinary one, whose lanes no tag turns away."""
    tags = road.tags
    marked = any(name.startswith("turn:lanes") or name.startswith("change:") for name in tags)
    odd = tags.get("junction") or tags.get("tunnel") or tags.get("bridge")
    closed = any(tags.get(who, "yes") != "yes" for who in ("access", "motor_vehicle", "vehicle"))
    fast = tags["highway"].startswith(("motorway", "trunk")) or tags["highway"].endswith("_link")
    return not (marked or odd or closed or fast)


def _limit_kmh(road: RawRoad) -> float:
    if road.tagged_mps is not None:
        return 3.6 * road.tagged_mps
    return UNTAGGED_KMH.get(road.tags["highway"], 40.0)


def _bend(a: np.ndarray, b: np.ndarray, c: np.ndarray) -> float:
    before, after = b - a, c - b
    return _between(
        math.degrees(math.atan2(before[1], before[0])), math.degrees(math.atan2(after[1], after[0]))
    )
