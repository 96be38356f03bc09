"""Who of going traffic waits at the entry of a junction, so that nobody has to wait inside it.

Whoever stands inside a junction is in the way of others, who then are in the way of more: once a
circle of them is closed, nobody gets on for good. So all ground that a way shares with others in a
junction is one decision, made at its entry: who drives in has, or will have, all of it for itself,
and room behind it (StVO, the German road traffic regulations, § 11 paragraph 1). Of those who wait
for each other at entries, who came first goes first.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from foretwin.contracts.arrays import Array, Flags, Indices
from foretwin.geometry.polyline import arc_lengths
from foretwin.geometry.rectangles import Rectangles, overlapping
from foretwin.sim_worker import driver_model as driver
from foretwin.sim_worker.road_users.crowd import EgoBoxes
from foretwin.sim_worker.road_users.right_of_way import JunctionRules, Taken
from foretwin.sim_worker.road_users.traffic import Traffic

_ROOM_M = driver.STANDSTILL_GAP_M + driver.LINE_GAP_M
"""Between two junctions who is longer than the way between them less this has no room to stand."""
_AT_ENTRY_M = 4.0
"""Who stands with its front so near to an entry is the first there. Chosen."""
_PACE_MPS = 4.0
"""Who sets off crosses a junction about as fast. Chosen: as for ground of others."""
_FLOWS_MPS = 3.0
"""Behind who is faster there will be room. Chosen: as for the car under test."""
_SPARE_S = 1.5
"""Who drives in has the ground for itself so long before and after. Chosen: with 0.5 s before and
1 s after, who meant to be past somebody else at times met it."""
_LONG_M = 7.0
"""Who is longer and turns cuts corners: it needs all of the junction. Chosen: lorries and buses."""
_STEP_M = 1.0

_Stretch = tuple[float, ...]


class Mover(NamedTuple):
    """Who drives: the name that it keeps, what its way takes of connections, length and width."""

    name: str
    taken: tuple[Taken, ...]
    size_m: tuple[float, float]


class _Passage(NamedTuple):
    """A way through a junction: arc lengths of its entry and of where the last shared ground ends,
    the connection at its entry and the lane that it leads to."""

    enter_m: float
    clear_m: float
    entry: str
    exit: str


_NONE = _Passage(np.inf, np.inf, "", "")


class _EntryPairs(NamedTuple):
    """Ground that passages of two movers share (N,): who they are and which of their passages, its
    arc lengths (N, 4) on the one's and on the other's way, and whether the one waits by rule."""

    who: Indices
    at: Indices
    other: Indices
    there: Indices
    ground: Array
    yields: Flags


class _Now(NamedTuple):
    """Movers now (M,): arc lengths of their fronts and rears, speeds, places of their passages
    among theirs, -1 for none, and these; and of all boxes poses (M, 3) and sizes (M, 2)."""

    front_m: Array
    rear_m: Array
    speed_mps: Array
    at: Indices
    ways: Sequence[_Passage]
    poses: Array
    size_m: Array


class JunctionEntries:
    """The entries of one World's junctions, and who has been let in; the car is the first mover."""

    def __init__(self, rules: JunctionRules) -> None:
        self._shared: dict[str, dict[str, tuple[_Stretch, bool]]] = defaultdict(dict)
        for (wait, go), (stretch, by_rule) in rules.grounds().items():
            self._shared[wait][go] = tuple(stretch), by_rule
            self._shared[go][wait] = (*stretch[2:], *stretch[:2]), False
        self._movers: tuple[Mover, ...] = ()
        self._passages: list[list[_Passage]] = []
        self._let_in: dict[str, str] = {}
        """By name, the entry that somebody has been let in at."""
        self._since: dict[str, int] = {}
        """By name, at which decision somebody came to stand at an entry."""
        self._decisions = 0

    def use(self, movers: Sequence[Mover]) -> None:
        """Take who drives where from now on."""
        self._movers, self._passages = tuple(movers), []
        on: list[tuple[int, int, Taken]] = []
        for m, mover in enumerate(movers):
            passages: list[_Passage] = []
            self._passages.append(passages)
            for one in mover.taken:
                if one.connection.id in self._shared:
                    self._lead_through(passages, one, mover.size_m[0])
                    on.append((m, len(passages) - 1, one))
        rows = [
            (
                m,
                at,
                other,
                there,
                *np.add(stretch, np.repeat((one.from_arc_m, two.from_arc_m), 2)),
                by_rule,
            )
            for m, at, one in on
            for other, there, two in on
            if other != m
            for stretch, by_rule in self._ground(m, one, other, two)
        ]
        table = np.array(rows).reshape(-1, 9)
        who, at, other, there = table[:, :4].astype(np.intp).T
        self._pairs = _EntryPairs(who, at, other, there, table[:, 4:8], table[:, 8] > 0.5)

    def _lead_through(self, passages: list[_Passage], one: Taken, length_m: float) -> None:
        """Add a connection to the passages before it, or to the last of them where there is no room
        to stand between."""
        connection, from_m = one
        clear_m = from_m + max(span[1] for span, _ in self._shared[connection.id].values())
        if passages and from_m - passages[-1].clear_m < length_m + _ROOM_M:
            before = passages.pop()
            clear_m, exit_id = max(clear_m, before.clear_m), connection.to_lane_id
            passages.append(before._replace(clear_m=clear_m, exit=exit_id))
        else:
            passages.append(_Passage(from_m, clear_m, connection.id, connection.to_lane_id))

    def _ground(
        self, m: int, one: Taken, other: int, two: Taken
    ) -> Iterator[tuple[_Stretch, bool]]:
        """Yield the ground that two movers share on a connection each, if any."""
        mine, theirs = one.connection, two.connection
        shared = self._shared[mine.id].get(theirs.id)
        if shared is not None:
            yield shared
            return
        cuts = any(
            self._movers[k].size_m[0] > _LONG_M and way.turn != "straight"
            for k, way in ((m, mine), (other, theirs))
        )
        if cuts and mine.place_id == theirs.place_id and mine.from_lane_id != theirs.from_lane_id:
            ends = (float(arc_lengths(way.centerline)[-1]) for way in (mine, theirs))
            yield tuple(bound for end in ends for bound in (0.0, end)), False

    def closed(self, traffic: Traffic, car: EgoBoxes, red_arcs_m: Array) -> Array:
        """Return (M, 1) the arc lengths of entries before which movers have to wait now, infinite
        where they may go; `red_arcs_m` (M, K) are lines with lights that show no green."""
        self._decisions += 1
        now = self._now(traffic, car)
        speed = now.speed_mps
        enter = np.array([way.enter_m for way in now.ways])
        ahead = enter - now.front_m
        red = (red_arcs_m == enter[:, None]).any(axis=1)
        # As of red lights: who can no more stop goes on.
        inside = ahead <= np.square(speed) / (2.0 * driver.LINE_DECEL_MPS2) - driver.LINE_GAP_M
        let_in = np.array([self._has_been_let_in(m, way) for m, way in enumerate(now.ways)])
        asks = ~inside & (ahead < driver.SIGHT_M)
        asks[0] = False  # The car does as it does.
        pairs, at = self._pairs, now.at
        rows = np.flatnonzero(
            asks[pairs.who] & (at[pairs.who] == pairs.at) & (at[pairs.other] == pairs.there)
        )
        pairs = _EntryPairs._make(column[rows] for column in pairs)
        comes = pairs.yields & (speed >= driver.STANDING_MPS)[pairs.other] & ~red[pairs.other]
        # Who has been let in stays so but for those who are inside already.
        first = inside[pairs.other] | (~let_in[pairs.who] & (let_in[pairs.other] | comes))
        closed = np.zeros(len(ahead), dtype=bool)
        closed[pairs.who[first & _meet(pairs, now)]] = True
        near = ahead < np.square(speed) / (2.0 * driver.COMFORT_DECEL_MPS2) + _AT_ENTRY_M
        asks &= near & ~red
        for m in np.flatnonzero(asks & ~closed).tolist():
            closed[m] = not self._has_room(m, now, inside | let_in, traffic)
        stands = asks & (speed < driver.STANDING_MPS) & (ahead < _AT_ENTRY_M)
        self._remember(closed, stands)
        self._let_in_by_turns(closed, asks & ~closed, pairs, now.ways)
        return np.where(closed, enter, np.inf)[:, None]

    def _now(self, traffic: Traffic, car: EgoBoxes) -> _Now:
        arc = np.append(car.arc_m, traffic.arc_m[0])
        size = np.array([mover.size_m for mover in self._movers])
        rear = arc - 0.5 * size[:, 0]
        at, ways = np.full(len(arc), -1, dtype=np.intp), [_NONE] * len(arc)
        for m, passages in enumerate(self._passages):
            for p, way in enumerate(passages):
                if rear[m] < way.clear_m:
                    at[m], ways[m] = p, way
                    break
        speed = np.append(car.speed_mps, traffic.speed_mps[0])
        poses = np.concatenate([car.poses, traffic.poses[0]])
        return _Now(arc + 0.5 * size[:, 0], rear, speed, at, ways, poses, size)

    def _has_been_let_in(self, m: int, way: _Passage) -> bool:
        return self._let_in.get(self._movers[m].name) == way.entry

    def _has_room(self, m: int, now: _Now, going: Flags, traffic: Traffic) -> bool:
        """Return whether a mover has room behind its junction, and nobody stands in its way there;
        those who are `going` in before it to the same lane take theirs first."""
        way = now.ways[m]
        before = [
            k for k in np.flatnonzero(going).tolist() if k != m and now.ways[k].exit == way.exit
        ]
        room_m = float(np.sum(now.size_m[[m, *before], 0] + driver.STANDSTILL_GAP_M))
        along = np.arange(way.enter_m, way.clear_m + room_m, _STEP_M)
        own = traffic.table.paths[m].pose_at(along)
        reach_m = 0.5 * (along[-1] - along[0]) + now.size_m[:, 0]
        away_m = np.hypot(*(now.poses[:, :2] - own.xy_m[len(along) // 2]).T)
        slow = (now.speed_mps < _FLOWS_MPS) & (away_m < reach_m)
        slow[m] = False
        if not slow.any():
            return True
        mine = Rectangles(own.xy_m[:, None], own.yaw_rad[:, None], _STEP_M, now.size_m[m, 1])
        theirs = Rectangles(now.poses[slow, :2], now.poses[slow, 2], *now.size_m[slow].T)
        # Who moves on the shared ground will have left it.
        counts = (along > way.clear_m)[:, None] | (now.speed_mps[slow] < driver.STANDING_MPS)
        return not (overlapping(mine, theirs) & counts).any()

    def _remember(self, closed: Flags, stands: Flags) -> None:
        """Note who stands at an entry, and whom no entry lets in any more."""
        for m, mover in enumerate(self._movers):
            if stands[m]:
                self._since.setdefault(mover.name, self._decisions)
            else:
                self._since.pop(mover.name, None)
            if closed[m]:
                self._let_in.pop(mover.name, None)

    def _let_in_by_turns(
        self, closed: Flags, asks: Flags, pairs: _EntryPairs, ways: Sequence[_Passage]
    ) -> None:
        """Let in who asks: who came first, then who waits for fewer of the others by rule, then
        who has been there for longest; who shares ground with one of them finds it closed."""
        rivals: dict[int, set[int]] = defaultdict(set)
        waits_for = np.zeros(len(closed), dtype=np.intp)
        both = asks[pairs.who] & asks[pairs.other]
        np.add.at(waits_for, pairs.who[both], pairs.yields[both])
        for m, other in zip(pairs.who[both].tolist(), pairs.other[both].tolist(), strict=True):
            rivals[m].add(other)
        names = [mover.name for mover in self._movers]
        gone: set[int] = set()
        for m in sorted(
            np.flatnonzero(asks).tolist(),
            key=lambda m: (self._since.get(names[m], self._decisions), waits_for[m], m),
        ):
            if rivals[m] & gone:
                closed[m] = True
                self._let_in.pop(names[m], None)
            else:
                gone.add(m)
                self._let_in[names[m]] = ways[m].entry


def _meet(pairs: _EntryPairs, now: _Now) -> Flags:
    """Return (N,) whether the other needs the ground of a pair too soon."""
    who, other = pairs.who, pairs.other
    enter, leave, their_in, their_out = pairs.ground.T
    theirs, own = now.speed_mps[other], now.speed_mps[who]
    reach_s = (their_in - now.front_m[other]) / np.maximum(theirs, _PACE_MPS)
    gone_s = (their_out - now.rear_m[other]) / np.maximum(theirs, driver.STANDING_MPS)
    pace = np.maximum(own, _PACE_MPS)
    enter_s = np.maximum(enter - now.front_m[who], 0.0) / pace
    # Who is slower than it will be takes its time to get there, and who stands to notice.
    clear_s = (leave - now.rear_m[who]) / pace
    clear_s += np.square(pace - own) / (2.0 * driver.MAX_ACCEL_MPS2 * pace)
    clear_s += np.where(own < driver.STANDING_MPS, driver.OTHERS_REACTION_S[0], 0.0)
    needs = (gone_s > 0.0) & (gone_s > enter_s - _SPARE_S)
    return np.asarray(needs & (reach_s < clear_s + _SPARE_S))
