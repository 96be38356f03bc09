"""Where paths meet, and that each meeting has exactly one answer."""

from __future__ import annotations

import itertools
import math
from pathlib import Path

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st

from foretwin.contracts.world import Conflict, Connection, World
from foretwin.world_gen.build import build_region
from foretwin.world_gen.connections import conflicts
from foretwin.world_gen.connections.conflicts import SWEPT_HALF_WIDTH_M
from foretwin.world_gen.osm.osm_map import OsmMap
from foretwin.world_gen.osm.read_osm import read_map
from foretwin.world_gen.roads.build_graph import build_road_graph
from tests.world_gen.drawn_maps import GERMANY, IRELAND, crossing, drawn_map, roundabout, world_of


def star(bearings_deg: list[float], *, left_hand: bool = False, **tags: str) -> OsmMap:
    """Residential roads of 90 m that meet in node 0; where traffic keeps left, mirrored."""
    sign = -1.0 if left_hand else 1.0
    nodes = {0: (0.0, 0.0)}
    ways = []
    for i, bearing in enumerate(bearings_deg, start=1):
        angle = math.radians(bearing)
        nodes[i] = (sign * 90.0 * math.cos(angle), 90.0 * math.sin(angle))
        ways.append((10 + i, [0, i], {"highway": "residential", "name": f"Arm {i}", **tags}))
    return drawn_map(nodes, ways, origin=IRELAND if left_hand else GERMANY)


def apart(count: int) -> st.SearchStrategy[list[float]]:
    """Bearings of roads that lie at least 40 degrees apart, turned as a whole."""
    gaps = st.lists(st.floats(0.0, 1.0), min_size=count, max_size=count)
    free = 360.0 - 40.0 * count

    def placed(parts: tuple[list[float], float]) -> list[float]:
        shares, turn = parts
        whole = sum(shares) or 1.0
        steps = [40.0 + free * share / whole for share in shares]
        return [(turn + at) % 360.0 for at in itertools.accumulate([0.0, *steps[:-1]])]

    return st.tuples(gaps, st.floats(0.0, 360.0)).map(placed)


def check(world: World) -> None:
    """Fail where a conflict lacks its one answer, or connections tell another story."""
    by_id = {c.id: c for c in world.connections}
    seen: set[frozenset[str]] = set()
    conflicting: dict[str, set[str]] = {name: set() for name in by_id}
    yields: dict[str, set[str]] = {name: set() for name in by_id}
    for c in world.conflicts:
        a, b = by_id[c.first_id], by_id[c.second_id]
        assert a.junction_id == b.junction_id != ""
        assert a.from_lane_id != b.from_lane_id
        assert (c.kind == "merging") == (a.to_lane_id == b.to_lane_id)
        pair = frozenset((a.id, b.id))
        assert len(pair) == 2
        assert pair not in seen
        seen.add(pair)
        assert c.yields_id in pair
        (winner,) = pair - {c.yields_id}
        conflicting[a.id].add(b.id)
        conflicting[b.id].add(a.id)
        yields[c.yields_id].add(winner)
        area = shapely.LinearRing(c.area)
        assert area.is_ccw
        for path in (a, b):
            line = shapely.LineString(path.centerline)
            assert line.distance(shapely.Point(c.point)) < 2.0 * SWEPT_HALF_WIDTH_M
            assert shapely.distance(line, shapely.points(c.area)).max() < 2.0
    for name, c in by_id.items():
        assert set(c.conflicts_with) == conflicting[name]
        assert set(c.yields_to) == yields[name]


def overlap_m2(a: Connection, b: Connection) -> float:
    """Return the area that cars on both paths sweep, found with buffers."""
    wide = [
        shapely.buffer(shapely.LineString(c.centerline), SWEPT_HALF_WIDTH_M, cap_style="flat")
        for c in (a, b)
    ]
    return float(shapely.intersection(*wide).area)


def conflict_of(world: World, first: str, second: str) -> Conflict | None:
    """Return the conflict of two movements, each given by the names of its roads."""
    name = {lane.id: lane.name for lane in world.lanes}
    movement = {c.id: f"{name[c.from_lane_id]}>{name[c.to_lane_id]}" for c in world.connections}
    return next(
        (
            c
            for c in world.conflicts
            if {movement[c.first_id], movement[c.second_id]} == {first, second}
        ),
        None,
    )


@settings(max_examples=15, deadline=None)
@given(bearings=st.one_of(apart(3), apart(4), apart(5)))
def test_conflicts_are_the_pairs_whose_swept_areas_overlap(bearings):
    world = world_of(star(bearings))
    check(world)
    known = {frozenset((c.first_id, c.second_id)): c for c in world.conflicts}
    for a, b in itertools.combinations(world.connections, 2):
        found = known.get(frozenset((a.id, b.id)))
        if a.from_lane_id == b.from_lane_id:
            assert found is None
            continue
        shared = overlap_m2(a, b)
        assert found is not None or shared < 0.6
        assert found is None or shared > 0.1
        if found is not None:
            assert shapely.Polygon(found.area).area == pytest.approx(shared, rel=0.3, abs=0.6)


@settings(max_examples=12, deadline=None)
@given(bearings=apart(4))
def test_a_mirrored_map_has_the_mirrored_answers(bearings):
    world, mirrored = (world_of(star(bearings, left_hand=side)) for side in (False, True))
    answers = [
        {frozenset((c.first_id, c.second_id)): (c.yields_id, c.rule) for c in w.conflicts}
        for w in (world, mirrored)
    ]
    assert answers[0].keys() == answers[1].keys()
    assert answers[0] == answers[1]


def test_roads_of_two_levels_meet_where_a_bridge_begins_at_the_junction():
    over = {"highway": "residential", "name": "Street", "bridge": "yes", "layer": "1"}
    world = world_of(crossing(street=over))
    check(world)
    found = conflict_of(world, "Street>Street", "Avenue>Avenue")
    assert found is not None
    assert found.kind == "crossing"
    assert np.hypot(*found.point) < 4.0


@pytest.mark.parametrize("clockwise", [False, True])
def test_ring_and_entries_meet_across_places(clockwise):
    origin = IRELAND if clockwise else GERMANY
    world = world_of(roundabout(origin=origin, clockwise=clockwise))
    check(world)
    role = {lane.id: lane.role for lane in world.lanes}
    by_id = {c.id: c for c in world.connections}
    entering = [c for c in world.conflicts if c.rule == "roundabout"]
    assert len(entering) >= 3
    for c in entering:
        assert role[by_id[c.yields_id].from_lane_id] == "approach"
        assert c.source == "tagged"


def test_what_two_threads_find_is_what_one_does(monkeypatch):
    world = world_of(star([0.0, 80.0, 170.0, 260.0]))
    assert len(world.conflicts) % 2 == 0
    monkeypatch.setattr(conflicts, "_WORTH_A_THREAD", 3)
    shared = world_of(star([0.0, 80.0, 170.0, 260.0]))
    assert [str(c) for c in shared.conflicts] == [str(c) for c in world.conflicts]


@pytest.mark.real_data
@pytest.mark.parametrize(
    "name", ["osm-berlin-mitte/berlin-mitte.osm", "osm-kingsway/kingsway_junction.osm"]
)
def test_a_real_town_has_one_answer_to_every_conflict(data_dir: Path, name: str):
    osm = read_map(data_dir / name)
    world = build_region(osm, build_road_graph(osm), osm.bounds)
    assert len(world.conflicts) > 40
    check(world)
