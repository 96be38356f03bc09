"""What is green together in a World, judged from its geometry alone.

`python -m tests.world_gen.green_together` prints a line for each map in `FORETWIN_DATA`, and every
fault; with names (or parts of them), for those maps alone. Nothing here uses the generator's
groups, conflicts or clearances: cars are boxes drawn along the paths of connections.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator, Mapping, Sequence
from itertools import combinations

import msgspec
import numpy as np
import shapely

from foretwin.contracts.signals import SignalPlan
from foretwin.contracts.world import Connection, Crossing, Lane, World
from tests.world_gen.where_lanes_lead import maps_named, whole_world

HALF_CAR_M = 0.9
SHARED_M2 = 1.5
"""Cars that share less ground than this pass each other."""
ONCOMING_COS = -0.5
WALK_NEAR_M = 25.0
"""Crossings are on the road before or behind a junction up to here."""


class Faults(msgspec.Struct, frozen=True, kw_only=True):
    """What is wrong with the lights of a World, in words, and what was looked at."""

    found: tuple[str, ...]
    junctions: int
    lit: int
    """Connections that have a group."""
    bare: int
    """Those at signalled junctions without one that meet others: a sign or rule says who waits."""
    pairs: int
    """Pairs of lit connections whose cars share ground."""


class _Car(msgspec.Struct, frozen=True):
    """A connection and the ground that a car sweeps along it."""

    c: Connection
    ground: shapely.Geometry
    first: tuple[float, float]

    @staticmethod
    def of(c: Connection) -> _Car:
        step = c.centerline[1] - c.centerline[0]
        ground = shapely.LineString(c.centerline).buffer(HALF_CAR_M, cap_style="flat")
        x, y = step / max(float(np.hypot(*step)), 1e-9)
        return _Car(c, ground, (float(x), float(y)))


def green_together(world: World) -> Faults:
    """Return every pair that a plan lets go together though their ways meet and neither waits, and
    every connection of a signalled junction that goes without a light into what is lit."""
    lanes = {lane.id: lane for lane in world.lanes}
    faults: list[str] = []
    junctions = lit = bare = pairs = 0
    for junction in world.junctions:
        if junction.summary.control != "signals":
            continue
        junctions += 1
        name = junction.summary.id
        if junction.plan is None:
            faults.append(f"{name}: has lights, but no plan")
            continue
        mine = [_Car.of(c) for c in world.connections if c.junction_id == name]
        lit += sum(car.c.signal_group_id is not None for car in mine)
        meets: dict[str, bool] = {}
        for a, b in combinations(mine, 2):
            if not _share_ground(a, b):
                continue
            groups = a.c.signal_group_id, b.c.signal_group_id
            if None not in groups:
                pairs += 1
                if groups[0] != groups[1] and _both_green(junction.plan, groups):
                    faults += _unguarded(a, b, lanes)
            elif not _one_road(a, b, lanes):
                fine = b.c.id in a.c.yields_to or a.c.id in b.c.yields_to
                for c in (car.c for car in (a, b) if car.c.signal_group_id is None):
                    meets[c.id] = meets.get(c.id, True) and fine
        bare += len(meets)
        faults += [f"{name}: {i} goes without a light or rule" for i, ok in meets.items() if not ok]
        faults += _walked_over(world, junction.plan, [car.c for car in mine], lanes)
    return Faults(found=tuple(faults), junctions=junctions, lit=lit, bare=bare, pairs=pairs)


def _share_ground(a: _Car, b: _Car) -> bool:
    same_way = a.c.from_lane_id == b.c.from_lane_id
    behind = a.c.to_lane_id == b.c.from_lane_id or b.c.to_lane_id == a.c.from_lane_id
    if same_way or behind or a.c.layer != b.c.layer:
        return False
    return bool(a.ground.intersection(b.ground).area > SHARED_M2)


def _both_green(plan: SignalPlan, groups: Sequence[str | None]) -> bool:
    return any(set(groups) <= set(phase.green_group_ids) for phase in plan.phases)


def _one_road(a: _Car, b: _Car, lanes: Mapping[str, Lane]) -> bool:
    """Return whether two set out side by side, where drivers look after each other."""
    return lanes[a.c.from_lane_id].road_id == lanes[b.c.from_lane_id].road_id


def _unguarded(a: _Car, b: _Car, lanes: Mapping[str, Lane]) -> Iterator[str]:
    """Yield a fault unless one turns across the other that comes towards it and waits, or both
    come side by side out of one road."""
    if _one_road(a, b, lanes):
        return
    oncoming = a.first[0] * b.first[0] + a.first[1] * b.first[1] < ONCOMING_COS
    for one, other in ((a, b), (b, a)):
        if other.c.id in one.c.yields_to and one.c.turn != "straight" and oncoming:
            return
    yield f"{a.c.junction_id}: {a.c.id} and {b.c.id} are green together"


def _walked_over(
    world: World, plan: SignalPlan, mine: Sequence[Connection], lanes: Mapping[str, Lane]
) -> Iterator[str]:
    """Yield where who walks is let go with cars that come in over the crossing, or leave over it
    straight on."""
    lines = {crossing.id: crossing for crossing in world.crossings}
    for walk in plan.groups:
        for crossing in (lines[name] for name in walk.crossing_ids):
            for c in mine:
                group = c.signal_group_id
                if group is None or not _both_green(plan, (group, walk.id)):
                    continue
                if _passes(c, crossing, lanes):
                    yield f"{c.junction_id}: {c.id} goes while {crossing.id} is walked over"


def _passes(c: Connection, crossing: Crossing, lanes: Mapping[str, Lane]) -> bool:
    before = shapely.LineString(lanes[c.from_lane_id].centerline[::-1])
    parts = [shapely.ops.substring(before, 0.0, WALK_NEAR_M)]
    if c.turn == "straight":
        behind = shapely.LineString(lanes[c.to_lane_id].centerline)
        parts.append(shapely.ops.substring(behind, 0.0, WALK_NEAR_M))
        parts.append(shapely.LineString(c.centerline))
    line = shapely.LineString(crossing.line)
    return any(part.intersects(line) for part in parts)


def main(wanted: Sequence[str]) -> None:
    """Print what was looked at on every map, and each fault."""
    for path in maps_named(wanted):
        found = green_together(whole_world(path))
        counts = (f"{getattr(found, n)} {n}" for n in ("junctions", "lit", "bare", "pairs"))
        print(f"{path.name}: {', '.join(counts)}, {len(found.found)} faults")
        print(*(f"  {fault}" for fault in found.found), sep="\n")


if __name__ == "__main__":
    main(sys.argv[1:])
