"""What is placed can be played: the counter, the judge, and the shares that both come to."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import shapely

from foretwin.sim_worker.scenarios.reading import catalogue
from tests.placed.counted_places import WANTED, counted, drives_left, found
from tests.placed.played_case import crosses
from tests.placed.played_map import PlayedMap, played_map
from tests.placed.raw_map import Plane, RawMap, RawRoad, read_raw

LEAST_PLAYABLE, LEAST_FOUND = 0.98, 0.95
GERMANY, ENGLAND = (10.0, 51.0), (-1.5, 53.0)


def street(id_: int, nodes: dict[int, tuple[float, float]], **tags: str) -> RawRoad:
    return RawRoad(
        id_, tuple(nodes), np.array(list(nodes.values())), {"highway": "tertiary"} | tags
    )


def crossing(at: tuple[float, float], *, arms: int = 4, **tags: str) -> RawMap:
    """Streets of 100 m to the east, west, south and north that meet at node 0."""
    lon, lat = at
    north, east = 100.0 / 111_250.0, 100.0 / (111_320.0 * np.cos(np.radians(lat)))
    ends = [(lon + east, lat), (lon - east, lat), (lon, lat - north), (lon, lat + north)]
    roads = [street(i, {0: at, i: end}, **tags) for i, end in enumerate(ends[:arms], start=1)]
    return RawMap(tuple(roads), (), frozenset(), ())


@pytest.mark.parametrize("at", [GERMANY, ENGLAND])
def test_a_crossing_of_main_roads_takes_all_that_needs_no_lights(at: tuple[float, float]) -> None:
    here = counted(crossing(at, maxspeed="50"))
    assert {id_ for id_, nodes in here.items() if nodes == {0}} == WANTED.keys() - {"red_light"}
    lit = crossing(at, maxspeed="50")._replace(lights=frozenset((0,)))
    assert counted(lit)["red_light"] == {0}


def test_a_t_junction_takes_what_needs_three_arms_and_slow_roads_what_is_slow() -> None:
    tee = counted(crossing(GERMANY, arms=3, maxspeed="50"))
    assert not tee["scp"]
    assert tee["ccftap"] == tee["rtip"] == {0}
    slow = counted(crossing(GERMANY, maxspeed="30"))
    assert not slow["lead_stopping"]
    assert slow["ccftap"] == {0}


def test_nothing_is_counted_where_a_house_stands_on_a_road_or_a_turn_is_forbidden() -> None:
    open_road = crossing(GERMANY, arms=2, maxspeed="50")
    assert not any(counted(open_road).values())
    built = crossing(GERMANY, maxspeed="50")
    house = shapely.Point(GERMANY).buffer(1e-5)
    assert not any(counted(built._replace(buildings=(house,))).values())
    barred = built._replace(no_turns=({"kind": "no_left_turn", "via": ("n", 0)},))
    assert not any(counted(barred).values())


@pytest.mark.parametrize(
    ("ways", "apart_m", "other_name", "counts"),
    [
        (("yes", "-1"), 22.0, "A", False),
        (("yes", "-1"), 153.0, "A", False),  # 80° apart, around a green.
        (("yes", "-1"), 22.0, "B", True),  # Another road, which one may turn back into.
        (("yes", "-1"), 280.0, "A", True),  # 114° apart: one turns.
        (("yes", "yes"), 22.0, "A", True),
        (("no", "-1"), 22.0, "A", True),
    ],
)
@pytest.mark.parametrize("whole_name", ["A", "C"])
def test_no_junction_is_where_a_road_becomes_its_own_carriageways(
    ways: tuple[str, str], apart_m: float, other_name: str, counts: bool, whole_name: str
) -> None:
    (lon, lat), whole = GERMANY, crossing(GERMANY, arms=1, maxspeed="50", name=whole_name)
    half_deg = apart_m / 2.0 / 111_250.0
    ends = {2: (lon - 0.0013, lat + half_deg), 3: (lon - 0.0013, lat - half_deg)}
    parts = [
        street(i, {0: GERMANY, i: ends[i]}, maxspeed="50", oneway=way, name=name)
        for i, way, name in zip(ends, ways, ("A", other_name), strict=True)
    ]
    here = counted(whole._replace(roads=(*whole.roads, *parts)))
    assert any(0 in nodes for nodes in here.values()) == counts


@pytest.mark.parametrize(
    ("apart_m", "other_name", "counts"), [(40.0, "A", False), (40.0, "B", True), (120.0, "A", True)]
)
def test_no_junction_is_where_a_one_way_road_forks_into_itself(
    apart_m: float, other_name: str, counts: bool
) -> None:
    """At 17° lanes part; at 43° one turns."""
    (lon, lat), apart_deg = GERMANY, apart_m / 111_250.0
    ends = {2: (lon - 0.0019, lat), 3: (lon - 0.0019, lat + apart_deg)}
    for come, go in (("yes", "-1"), ("-1", "yes")):
        whole = crossing(GERMANY, arms=1, maxspeed="50", name="A", oneway=go)
        parts = [
            street(i, {0: GERMANY, i: ends[i]}, maxspeed="50", oneway=come, name=name)
            for i, name in zip(ends, ("A", other_name), strict=True)
        ]
        here = counted(whole._replace(roads=(*whole.roads, *parts)))
        assert any(0 in nodes for nodes in here.values()) == counts


def test_a_road_that_is_open_by_its_tags_counts_and_one_for_some_does_not() -> None:
    for tag in ("access", "motor_vehicle", "vehicle"):
        assert counted(crossing(GERMANY, maxspeed="50", **{tag: "yes"}))["scp"] == {0}
        assert not any(counted(crossing(GERMANY, maxspeed="50", **{tag: "permit"})).values())


@pytest.mark.parametrize(("at_m", "alone"), [(22.0, False), (30.0, True)])
def test_another_junction_near_it_makes_one_that_is_not_plain(at_m: float, alone: bool) -> None:
    (lon, lat), built = GERMANY, crossing(GERMANY, maxspeed="50")
    at = (lon + at_m / (111_320.0 * np.cos(np.radians(lat))), lat)
    east = street(1, {0: GERMANY, 9: at, 1: (lon + 0.0015, lat)}, maxspeed="50")
    aside = street(9, {9: at, 10: (at[0], lat + 0.0009)}, maxspeed="50")
    here = counted(built._replace(roads=(east, *built.roads[1:], aside)))
    assert (0 in here["scp"]) == alone


def test_nobody_drives_into_a_road_that_ends_at_once() -> None:
    (lon, lat), built = GERMANY, crossing(GERMANY, arms=3, maxspeed="50")
    for metres, counts in ((10.0, False), (20.0, True)):
        south = street(3, {0: GERMANY, 3: (lon, lat - metres / 111_250.0)}, maxspeed="50")
        here = counted(built._replace(roads=(*built.roads[:2], south)))
        assert (here["cbta"] == {0}) == counts
        assert here["lead_stopping"] == {0}


def test_who_is_where_counts_by_the_side_that_is_driven_on() -> None:
    """One road of 50 km/h into one of 20 to the right: in Germany the near turn, else across."""
    for at, id_, other in ((GERMANY, "cbta", "cpta"), (ENGLAND, "cpta", "cbta")):
        whole = crossing(at, maxspeed="50")
        east, west, _, _ = whole.roads
        # From the west one turns right into the south; nothing else may be driven.
        west = west._replace(tags=west.tags | {"oneway": "-1"})
        south = whole.roads[2]._replace(tags=whole.roads[2].tags | {"oneway": "yes"})
        north = whole.roads[3]._replace(tags=whole.roads[3].tags | {"oneway": "-1"})
        roads = (east._replace(tags=east.tags | {"oneway": "yes"}), west, south, north)
        here = counted(whole._replace(roads=roads))
        assert here[id_] == {0}, at
        assert drives_left(*at) == (at == ENGLAND)
        assert here[other] == {0}  # From the north into the east.


def test_what_is_found_is_asked_at_what_was_looked_at() -> None:
    here = found({1, 2, 3, 4}, placed={1}, looked_at={1, 2}, known=frozenset((1, 2, 3)))
    assert here == (3, 1, (2, 4))  # 3 was not looked at, 4 is no junction that is known.


def test_ways_to_one_arm_merge() -> None:
    merges = {
        id_ for id_, s in catalogue().items() if s.actors and not crosses(s, s.actors[0].name)
    }
    assert {"ltip", "rtip", "lead_stopping"} <= merges
    assert not {"scp", "cccscp", "ccftap", "ltap_od"} & merges


def test_metres_around_a_place_are_those_of_the_ellipsoid() -> None:
    xy = Plane(53.0, -1.5).xy_m(np.array([[-1.498, 53.0013]]))
    assert xy[0] == pytest.approx([134.270, 144.674], abs=0.01)


def check(result: PlayedMap, raw: RawMap) -> None:
    cases = [case for junction in result.junctions for case in junction.played]
    playable = sum(not case.verdict.against for case in cases)
    wrong = [(c.scenario_id, c.junction_id, c.verdict) for c in cases if c.verdict.against]
    assert playable >= LEAST_PLAYABLE * len(cases), wrong
    assert max(c.verdict.off_m for c in cases if c.verdict.promised) <= 0.1
    looked_at = {node for junction in result.junctions for node in junction.osm_nodes}
    applies = placed = 0
    for id_, nodes in counted(raw).items():
        mine = {n for j in result.junctions if id_ in j.placed for n in j.osm_nodes}
        here = found(nodes, mine, looked_at, result.known_nodes)
        applies, placed = applies + here.applies, placed + here.placed
    assert placed >= LEAST_FOUND * applies


@pytest.mark.real_data
def test_what_is_placed_at_two_junctions_that_keep_left_can_be_played(data_dir: Path) -> None:
    file = data_dir / "osm-kingsway" / "kingsway_junction.osm"
    raw = read_raw(file)
    result = played_map(file, raw, most=2)
    assert sum(len(junction.played) for junction in result.junctions) >= 20
    check(result, raw)


@pytest.mark.judge
@pytest.mark.real_data
@pytest.mark.timeout(1800)
@pytest.mark.parametrize(
    "name",
    [
        "osm-badhersfeld/badhersfeld.osm.xml.gz",
        "osm-leeds/leeds.osm.gz",
        "osm-austin-downtown/austin.osm.gz",
        "osm-monaco/monaco.osm.gz",
        "osm-berlin-moritzplatz/berlin-moritzplatz.osm",
    ],
)
def test_what_is_placed_on_a_map_can_be_played(data_dir: Path, name: str) -> None:
    raw = read_raw(data_dir / name)
    check(played_map(data_dir / name, raw, most=30), raw)
