"""Nobody sees through a house, and everybody past its corner."""

from __future__ import annotations

import msgspec
import numpy as np
import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st

from foretwin.contracts.beside_road import Building, Obstacle
from foretwin.contracts.world import Quantity, World
from foretwin.sim_worker.road_users.sight_lines import CELL_M, OpaqueGrid, hidden, opaque_grid
from tests.orchestrator.trip import town_world

CORNER = ((10.0, 5.0), (40.0, 5.0), (40.0, 30.0), (10.0, 30.0))
"""A house on the left of a street along x."""


@pytest.fixture(scope="module")
def empty() -> World:
    return msgspec.structs.replace(town_world("n4"), buildings=(), obstacles=())


def house(low_m: float = 0.0, *, outline: tuple[tuple[float, float], ...] = CORNER) -> Building:
    height = Quantity(value=9.0, source="tagged")
    ring = np.array(outline)
    return Building(id="w1", outline=ring, holes=(), height_m=height, min_height_m=low_m)


def grid(empty: World, *houses: Building) -> OpaqueGrid:
    found = opaque_grid(msgspec.structs.replace(empty, buildings=houses))
    assert found is not None
    return found


def sees(walls: OpaqueGrid, eye: tuple[float, float], pose: tuple[float, float, float]) -> bool:
    """Whether a person at `eye` sees a car of 4 m."""
    eyes, poses = np.array([eye]), np.array([[pose]])
    return not hidden(walls, eyes, poses, np.full((1, 1), 4.0))[0, 0]


@pytest.mark.parametrize("x_m", [-40.0, 0.0, 9.0, 30.0, 42.0])
def test_who_comes_from_behind_the_corner_is_seen_where_the_street_opens(
    empty: World, x_m: float
) -> None:
    walls = grid(empty, house())
    assert sees(walls, (x_m, 0.0), (45.0, 0.0, 0.0)), "ahead on the street nothing is hidden"
    assert sees(walls, (x_m, 0.0), (5.0, 25.0, -np.pi / 2)) == (x_m < 12.0)
    assert sees(walls, (x_m, 0.0), (45.0, 25.0, -np.pi / 2)) == (x_m > 38.75)


def test_the_nose_of_a_car_is_seen_before_its_middle(empty: World) -> None:
    walls = grid(empty, house())
    down = -np.pi / 2
    assert not sees(walls, (0.0, 0.0), (45.0, 26.0, down))
    assert not sees(walls, (0.0, 0.0), (44.0, 8.0, down))
    assert sees(walls, (0.0, 0.0), (44.0, 6.5, down))


def test_what_stands_on_pillars_hides_nothing(empty: World) -> None:
    assert opaque_grid(msgspec.structs.replace(empty, buildings=(house(4.0),))) is None


@pytest.mark.parametrize(
    ("eye", "other"), [((20.0, 10.0), (25.0, -20.0)), ((20.0, -5.0), (25.0, 15.0))]
)
def test_who_stands_in_a_wall_is_where_the_map_is_wrong(
    empty: World, eye: tuple[float, float], other: tuple[float, float]
) -> None:
    assert sees(grid(empty, house()), eye, (*other, 0.0))


def test_a_car_beside_a_courtyard_does_not_see_into_it(empty: World) -> None:
    block = shapely.box(-20.0, 5.0, 20.0, 45.0).exterior
    yard = np.array(shapely.box(-10.0, 15.0, 10.0, 35.0).exterior.coords)[:-1]
    outline = np.array(block.coords)[:-1]
    building = msgspec.structs.replace(house(), outline=outline, holes=(yard,))
    walls = grid(empty, building)
    assert not sees(walls, (0.0, 0.0), (0.0, 25.0, 0.0))
    assert sees(walls, (-5.0, 20.0), (5.0, 30.0, 0.0))


def test_a_thin_wall_hides_and_a_fence_does_not(empty: World) -> None:
    outline = np.array([(10.0, -20.0), (10.2, -20.0), (10.2, 20.0), (10.0, 20.0)])
    height = Quantity(value=1.8, source="default")
    wall = Obstacle(id="w2", kind="wall", outline=outline, height_m=height)
    walls = opaque_grid(msgspec.structs.replace(empty, obstacles=(wall,)))
    assert walls is not None
    for degrees in range(-60, 61, 3):
        far = 30.0 * np.cos(np.radians(degrees)), 30.0 * np.sin(np.radians(degrees))
        assert not sees(walls, (0.0, 0.0), (*far, 0.0)), degrees
    fence = msgspec.structs.replace(wall, kind="fence")
    assert opaque_grid(msgspec.structs.replace(empty, obstacles=(fence,))) is None


coordinate = st.floats(-60.0, 60.0)


@given(coordinate, coordinate, coordinate, coordinate)
def test_it_agrees_with_geometry_but_for_a_cell(x: float, y: float, u: float, v: float) -> None:
    empty = msgspec.structs.replace(town_world("n4"), buildings=(), obstacles=())
    walls = grid(empty, house())
    corner = shapely.Polygon(CORNER)
    line = shapely.LineString([(x, y), (u, v)])
    pose = np.array([[[u, v, 0.0]]])
    found = hidden(walls, np.array([[x, y]]), pose, np.zeros((1, 1)))[0, 0]
    if not line.intersects(corner.buffer(CELL_M)):
        assert not found
    ends_outside = not corner.buffer(CELL_M).intersects(shapely.MultiPoint([(x, y), (u, v)]))
    if ends_outside and line.intersection(corner.buffer(-CELL_M)).length > CELL_M:
        assert found
