"""Nobody enters a junction that it could not leave: waiting is for its entries."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import msgspec
import numpy as np
import pytest

from foretwin.contracts.world import World
from foretwin.geometry.frenet_path import FrenetPath
from foretwin.sim_worker.road_users.cast import Player, casting
from foretwin.sim_worker.road_users.crowd import EgoBoxes
from foretwin.sim_worker.road_users.path_table import PathTable
from foretwin.sim_worker.road_users.right_of_way import JunctionRules
from foretwin.sim_worker.road_users.traffic import Traffic
from foretwin.sim_worker.virtual_traffic.entries import JunctionEntries, Mover
from tests.sim_worker.road_users.crossroads import crossroads, path_of, straight_on

EAST, NORTH, WEST, SOUTH = (1.0, 0.0), (0.0, 1.0), (-1.0, 0.0), (0.0, -1.0)
AWAY = FrenetPath(np.array([[900.0, 900.0], [999.0, 900.0]]))
CAR = EgoBoxes(np.array([[900.0, 900.0, 0.0]]), np.zeros(1), 0, np.zeros(1), 4.5, 1.8)
CAR_M, LORRY_M = (4.5, 1.8), (9.0, 2.4)
NO_RED = np.full((9, 1), np.inf)


class Driver(NamedTuple):
    """Whose front is so far before the entry of its junction, with what speed."""

    path: FrenetPath
    before_m: float
    speed_mps: float = 0.0
    size_m: tuple[float, float] = CAR_M


@pytest.fixture
def world(tmp_path: Path) -> World:
    return crossroads(tmp_path)


class Place:
    """The junction's entries, as decisions are made one after the other."""

    def __init__(self, world: World) -> None:
        self._rules = JunctionRules(world)
        self._entries = JunctionEntries(self._rules)

    def waits(self, *drivers: Driver) -> list[bool]:
        taken = [self._rules.taken(one.path) for one in drivers]
        players = [
            Player(
                name=f"{k}", kind="car", path=one.path, speed_mps=one.speed_mps,
                start_arc_m=at[0].from_arc_m - one.before_m - one.size_m[0] / 2.0,
                conduct="law_abiding", size_m=one.size_m,
            )
            for k, (one, at) in enumerate(zip(drivers, taken, strict=True))
        ]  # fmt: skip
        cast = casting([players], ego_path=AWAY, keys=[0])
        rules = self._rules.between([(), *taken])
        traffic = Traffic(cast.crowd, PathTable(cast.paths), rules, cast.paces)
        movers = [
            Mover(f"{k}", at, one.size_m)
            for k, (one, at) in enumerate(zip(drivers, taken, strict=True))
        ]
        self._entries.use([Mover("the car", (), CAR_M), *movers])
        closed = self._entries.closed(traffic, CAR, NO_RED[: len(drivers) + 1])
        return np.isfinite(closed[1:, 0]).tolist()


def ways(world: World, *headings: tuple[float, float]) -> list[FrenetPath]:
    return [straight_on(world, heading) for heading in headings]


def turning(world: World, turn: str, heading: tuple[float, float]) -> FrenetPath:
    """Return the path that comes from where `heading` leads and turns."""
    for one in world.connections:
        step = one.centerline[1] - one.centerline[0]
        if one.turn == turn and step @ np.asarray(heading) > 0.9 * np.hypot(*step):
            return path_of(world, one)
    raise LookupError(f"nobody turns {turn} from {heading}")


def test_on_a_free_junction_nobody_waits(world: World) -> None:
    east, north = ways(world, EAST, NORTH)
    assert Place(world).waits(Driver(east, 1.0)) == [False]
    assert Place(world).waits(Driver(east, 10.0, 8.0), Driver(north, 400.0, 8.0)) == [False, False]


def test_who_has_priority_waits_for_one_that_is_inside_all_the_same(world: World) -> None:
    """Right before left: who drives east waits for who drives north, but not from inside."""
    east, north = ways(world, EAST, NORTH)
    assert Place(world).waits(Driver(east, -4.0), Driver(north, 1.0)) == [False, True]
    assert Place(world).waits(Driver(east, -40.0, 8.0), Driver(north, 1.0)) == [False, False]


def test_who_has_priority_and_comes_is_waited_for_at_the_entry(world: World) -> None:
    east, north = ways(world, EAST, NORTH)
    assert Place(world).waits(Driver(east, 1.0), Driver(north, 30.0, 8.0)) == [True, False]


def test_nobody_enters_where_there_is_no_room_behind(world: World) -> None:
    """The way over this junction is about 20 m long: the rear of the other is beyond it, or so far
    that a car fits between."""
    (east,) = ways(world, EAST)
    found = [
        Place(world).waits(Driver(east, 1.0), Driver(east, -way_m, speed))[0]
        for way_m, speed in ((27.0, 0.0), (27.0, 5.0), (40.0, 0.0))
    ]
    assert found == [True, False, False]


def test_of_four_that_stand_at_their_entries_one_goes_and_then_the_next(world: World) -> None:
    place, paths = Place(world), ways(world, EAST, NORTH, WEST, SOUTH)
    first = place.waits(*(Driver(path, 1.0) for path in paths))
    assert sum(first) == 2  # Two that drive in opposite directions do not meet.
    on = [1.0 if waits else -60.0 for waits in first]
    then = place.waits(*(Driver(path, m) for path, m in zip(paths, on, strict=True)))
    assert not any(then)


def test_who_came_first_goes_first(world: World) -> None:
    for later in (0, 1):
        place, paths = Place(world), ways(world, EAST, NORTH)
        crossing = [Driver(paths[k], 20.0 if k == later else 1.0) for k in (0, 1)]
        blocks = Driver(straight_on(world, (1.0, 0.0)), -5.0)
        south = Driver(straight_on(world, SOUTH), -5.0)
        place.waits(*crossing, blocks, south)
        both = [one._replace(before_m=1.0) for one in crossing]
        assert place.waits(*both) == [later == 0, later == 1]


def test_a_lorry_that_turns_needs_the_whole_junction(world: World) -> None:
    """Two that turn left from opposite sides pass in front of each other, but for a long one."""
    east, west = turning(world, "left", EAST), turning(world, "left", WEST)
    inside = Driver(east, -6.0)
    assert Place(world).waits(inside, Driver(west, 1.0, size_m=LORRY_M)) == [False, True]


def test_ground_that_lights_keep_apart_is_still_taken_by_who_is_late(tmp_path: Path) -> None:
    world = crossroads(tmp_path, centre={"highway": "traffic_signals"})
    east, north = ways(world, EAST, NORTH)
    assert Place(world).waits(Driver(east, -8.0), Driver(north, 1.0)) == [False, True]
    none = msgspec.structs.replace(world, conflicts=())
    assert Place(none).waits(Driver(east, -8.0), Driver(north, 1.0)) == [False, False]
