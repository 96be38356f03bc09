"""Count stop lines that lie on pedestrian crossings, or behind them, over whole maps.

`python -m tests.world_gen.measure_stop_lines [NAME ...]` reads the folder named by FORETWIN_DATA
and prints a row for each map, and one for all, of marked crossings that a lane leads over and that
the World itself draws:

- `lines`: stop lines, those of lights away from junctions and of signs inside them among them;
- `on`: lines that lie on the ground of such a crossing, or less than 0.5 m from it;
- `behind`: those on the junction's side of one, with less than a car's length between;
- `room`: those on its side with room for a car between, and no more than `NEAR_M`: where one waits
  at a ring or gives way behind a crossing of its own that is no fault;

`on` and `behind` are told by how the line's control came about (tagged/inferred/default), by that
control (signal/stop/give_way/none), and by the control of the junction that the lane leads to.
`bare` counts lines on or behind crossings without marks.

`--worst N` names the N lines farthest past the place 1 m before their crossing, `--sample N` draws
N others by `--seed`.
"""

from __future__ import annotations

import argparse
import random
from collections import Counter
from collections.abc import Iterator, Sequence
from typing import NamedTuple

import shapely

from foretwin.contracts.frames import geo_from_local
from foretwin.contracts.world import Crossing, StopLine, World
from tests.world_gen.data_maps import MAPS, data_folder, named
from tests.world_gen.where_lanes_lead import whole_world

ON_M = 0.5
CAR_M = 4.74
"""A car that waits between a crossing and its line needs so much room (RASt 06)."""
NEAR_M, LOOK_M = 16.0, 50.0
"""Crossings farther before a line are none of its junction's; ways are followed so far for them."""
BEFORE_M = 1.0
SOURCES = "tagged", "inferred", "default"
CONTROLS = "signal", "stop", "give_way", "none"


class Case(NamedTuple):
    """A stop line and the crossing on its lane's way that it lies on or behind."""

    line: StopLine
    crossing: Crossing
    kind: str
    """on, behind or room."""
    past_m: float
    """How far along the way the line lies past the place `BEFORE_M` before the crossing."""
    junction_control: str
    marked: bool
    place: str


class _Ways:
    """The ways of a World on which lanes are come to and left."""

    def __init__(self, world: World) -> None:
        self._lines = {one.id: one.centerline for one in (*world.lanes, *world.connections)}
        self._before: dict[str, list[str]] = {}
        self._behind: dict[str, list[str]] = {}
        # A crossing before a junction that one has passed is that junction's.
        passed = {c.id for c in world.connections if c.junction_id}
        joins = [(c.from_lane_id, c.id) for c in world.connections]
        joins += [(c.id, c.to_lane_id) for c in world.connections]
        joins += [(a.id, b) for a in world.lanes for b in a.successor_ids if b not in passed]
        for a, b in dict.fromkeys(joins):
            self._behind.setdefault(a, []).append(b)
            if a not in passed:
                self._before.setdefault(b, []).append(a)

    def past_m(self, line: StopLine, walked: shapely.LineString) -> float | None:
        """Return how far on its lane's way a line lies past the place before a crossing; None where
        no way leads over it."""
        name = line.across_id
        across = shapely.LineString(line.ends)
        met = []
        for way in self._on(name, -1):
            path = shapely.LineString(way)
            line_m = path.project(path.intersection(across).centroid)
            met += [at_m - line_m for at_m in _met_m(path, walked)]
        own_m = min(
            (m for m in _met_m(shapely.LineString(self._lines[name][::-1]), across)), default=0.0
        )
        for other in self._behind.get(name, ()):
            for way in self._on(other, 1):
                met += [-at_m - own_m for at_m in _met_m(shapely.LineString(way), walked)]
        return min(met, key=abs) if met else None

    def _on(self, name: str, step: int, gone_m: float = 0.0) -> Iterator[list[tuple[float, float]]]:
        """Yield the ways on along a line, forward or back, as points, no farther than is looked."""
        mine = [(x, y) for x, y in self._lines[name][::step].tolist()]
        gone_m += shapely.LineString(mine).length
        after = (self._behind if step > 0 else self._before).get(name, [])
        if gone_m > LOOK_M or not after:
            yield mine
            return
        for other in after:
            for way in self._on(other, step, gone_m):
                yield [*mine, *way]


def _met_m(path: shapely.LineString, walked: shapely.LineString) -> list[float]:
    """Return how far along a path it meets a line."""
    points = shapely.get_coordinates(path.intersection(walked))
    return [path.project(shapely.Point(point)) for point in points]


def cases(world: World) -> Iterator[Case]:
    """Yield for each stop line the worst crossing that it lies on or behind, if there is one."""
    if not world.crossings:
        return
    ways = _Ways(world)
    control_of = {j.summary.id: j.summary.control for j in world.junctions}
    leads_to = {c.from_lane_id: control_of.get(c.junction_id, "-") for c in world.connections}
    walked = shapely.linestrings([c.line for c in world.crossings])
    ground = shapely.buffer(
        walked, [c.width_m.value / 2.0 for c in world.crossings], cap_style="flat"
    )
    tree = shapely.STRtree(ground)
    for line in world.stop_lines:
        middle = shapely.Point(line.ends.mean(axis=0))
        near = tree.query(middle, predicate="dwithin", distance=LOOK_M)
        found = []
        for i in near.tolist():
            crossing, middle_m = world.crossings[i], ways.past_m(line, walked[i])
            if middle_m is None or abs(middle_m) > NEAR_M:
                continue
            half_m = crossing.width_m.value / 2.0
            gap_m, past_m = middle_m - half_m, middle_m + half_m + BEFORE_M
            on = shapely.distance(shapely.LineString(line.ends), ground[i]) < ON_M
            if on or gap_m > 0.0:
                kind = "on" if on else "behind" if gap_m < CAR_M else "room"
                found.append((kind, crossing.kind.value != "unmarked", past_m, crossing))
        if not found:
            continue
        order = {"on": 2, "behind": 2, "room": 1}
        kind, marked, past_m, crossing = max(found, key=lambda f: (f[1], order[f[0]], f[2]))
        lat, lon = geo_from_local(world.frame, line.ends.mean(axis=0)[None])[0]
        leads = leads_to.get(line.lane_id, "-")
        yield Case(line, crossing, kind, past_m, leads, marked, f"{lat:.6f},{lon:.6f}")


def row_of(found: Sequence[Case], lines: int) -> str:
    """Return the figures of one map, or of several, as a row."""
    marked = [one for one in found if one.marked]
    kinds = Counter(one.kind for one in marked)
    faults = [one for one in marked if one.kind != "room"]
    sources = Counter(one.line.control.source for one in faults)
    controls = Counter(one.line.control.value for one in faults)
    junctions = Counter(one.junction_control for one in faults)
    bare = sum(not one.marked and one.kind != "room" for one in found)
    words = " ".join(f"{name} {n}" for name, n in sorted(junctions.items()))
    return (
        f"{lines:6d} lines  on {kinds['on']:3d}  behind {kinds['behind']:3d}  "
        f"room {kinds['room']:3d}  by source {'/'.join(str(sources[s]) for s in SOURCES)}  "
        f"control {'/'.join(str(controls[c]) for c in CONTROLS)}  bare {bare:3d}  {words}"
    )


def told(case: Case) -> str:
    """Return one case in words."""
    line, control = case.line, case.line.control
    return (
        f"    {case.past_m:5.1f} m {case.kind:6} {line.id} {control.value} {control.source}, "
        f"{case.junction_control}; {case.crossing.id} {case.crossing.kind.value} {case.place}"
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("names", nargs="*", metavar="NAME", help=", ".join(MAPS))
    parser.add_argument("--worst", type=int, default=0)
    parser.add_argument("--sample", type=int, default=0)
    parser.add_argument("--seed", type=int, default=0)
    asked = parser.parse_args()
    every: list[tuple[str, Case]] = []
    count = 0
    for name in named(asked.names, MAPS):
        world = whole_world(data_folder() / MAPS[name])
        found = list(cases(world))
        every += [(name, one) for one in found]
        count += len(world.stop_lines)
        print(f"{name:14}{row_of(found, len(world.stop_lines))}", flush=True)
    print(f"{'all':14}{row_of([one for _, one in every], count)}")
    faults = [item for item in every if item[1].marked and item[1].kind != "room"]
    faults.sort(key=lambda item: -item[1].past_m)
    rest = faults[asked.worst :]
    drawn = random.Random(asked.seed).sample(rest, min(asked.sample, len(rest)))
    for name, one in (*faults[: asked.worst], *drawn):
        print(f"{name:14}{told(one)}")


if __name__ == "__main__":
    main()
