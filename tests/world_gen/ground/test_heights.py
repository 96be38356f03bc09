import msgspec
import numpy as np
import pytest

from foretwin.contracts.arrays import Array
from foretwin.contracts.codec import content_bytes
from foretwin.contracts.elevation import Elevation
from foretwin.contracts.world import World
from foretwin.geometry.world_heights import heights_of, standing
from foretwin.world_gen.build import build_world
from foretwin.world_gen.junctions.find_intersections import find_intersections
from foretwin.world_gen.junctions.map_index import index_map
from foretwin.world_gen.osm.osm_map import OsmMap
from foretwin.world_gen.roads.build_graph import build_road_graph
from tests.world_gen.drawn_maps import GERMANY, drawn_map
from tests.world_gen.elevation.hills import Hill, raster

COVERS = ("foretwin.geometry.world_heights",)
STREET = {"highway": "residential"}
NODES = {
    0: (0.0, 0.0),
    1: (140.0, 0.0),
    2: (0.0, 140.0),
    3: (-140.0, 0.0),
    4: (0.0, -140.0),
    5: (700.0, 0.0),
    6: (-700.0, 0.0),
}
CROSSING = drawn_map(NODES, [(1, [6, 3, 0, 1, 5], STREET), (2, [2, 0, 4], STREET)])


def east(x: Array, y: Array) -> Array:
    return 50.0 + 0.06 * x


def world_on(hill: Hill | None, osm: OsmMap = CROSSING) -> World:
    graph = build_road_graph(osm)
    junctions = find_intersections(osm, graph)
    dem = None if hill is None else raster(hill, GERMANY)
    index = index_map(osm, graph, junctions, dem=dem)
    return build_world(osm, graph, junctions[0], radius_m=120.0, index=index)


def elevation_of(world: World) -> Elevation:
    assert not isinstance(world.elevation, msgspec.UnsetType)
    return world.elevation


def test_a_flat_world_says_nothing_of_heights() -> None:
    world = world_on(None)

    assert b"elevation" not in content_bytes(world)
    assert heights_of(world) is None


def test_heights_count_from_the_origin_and_follow_the_hill() -> None:
    world = world_on(east)
    heights, elevation = heights_of(world), elevation_of(world)
    assert heights is not None

    assert elevation.base_m == pytest.approx(50.0, abs=0.7)
    for lane in world.lanes:
        found = heights.along(lane, lane.centerline)
        assert found == pytest.approx(0.06 * lane.centerline[:, 0], abs=1.0)
    for connection in world.connections:
        found = heights.along(connection, connection.centerline)
        assert np.abs(found).max() < 2.0


def test_connections_go_on_from_lanes_at_their_height_and_grade() -> None:
    world = world_on(lambda x, y: 50.0 + 0.06 * x + 0.0003 * y * y)
    heights = heights_of(world)
    assert heights is not None
    lanes = {lane.id: lane for lane in world.lanes}

    for connection in world.connections:
        begin, end = lanes[connection.from_lane_id], lanes[connection.to_lane_id]
        along = heights.along(connection, connection.centerline)
        assert along[0] == pytest.approx(heights.along(begin, begin.centerline)[-1], abs=0.01)
        assert along[-1] == pytest.approx(heights.along(end, end.centerline)[0], abs=0.01)
        climbs = heights.slope(connection, spacing_m=0.05).grade
        assert climbs[0] == pytest.approx(heights.slope(begin, spacing_m=0.05).grade[-1], abs=0.003)
        assert climbs[-1] == pytest.approx(heights.slope(end, spacing_m=0.05).grade[0], abs=0.003)


def test_lanes_climb_as_they_are_driven() -> None:
    heights = heights_of(world := world_on(east))
    assert heights is not None

    for lane in world.lanes:
        slope = heights.slope(lane, spacing_m=4.0)
        assert slope.grade == pytest.approx(0.06 * slope.direction[:, 0], abs=0.012)


def test_the_ground_beside_a_road_is_as_high_as_the_road() -> None:
    def step(x: Array, y: Array) -> Array:
        # A terrace that falls beside the road, as between two cells of a raster.
        return np.where(y > 60.0, 20.0, 0.0)

    elevation = elevation_of(world_on(step))
    on_road = elevation.ground_at(np.array([[60.0, 0.0], [60.0, 5.0]]))
    away = elevation.ground_at(np.array([[60.0, 110.0]]))

    assert on_road[0] == pytest.approx(on_road[1], abs=0.5)
    assert away[0] - on_road[0] > 10.0


def test_what_stands_on_a_slope_is_as_high_over_its_highest_corner() -> None:
    heights = heights_of(world_on(east))
    house = np.array([[40.0, 15.0], [90.0, 15.0], [90.0, 45.0], [40.0, 45.0]])
    assert heights is not None
    ground = heights.surface_at(house)

    assert standing(None, house, 0.0, 9.0) == (0.0, 9.0)
    low, high = standing(heights, house, 0.0, 9.0)
    assert (low, high) == (ground.min(), ground.max() + 9.0)
    # A bridge between houses is as far over the street everywhere.
    low, high = standing(heights, house, 5.0, 9.0)
    assert (low, high) == (ground.max() + 5.0, ground.max() + 9.0)
    assert ground.max() - ground.min() > 2.0


def test_the_same_map_on_other_ground_is_another_world() -> None:
    assert world_on(east).id != world_on(None).id
    assert world_on(east).id == world_on(east).id


def test_what_the_map_joins_at_different_heights_is_named_and_has_no_heights() -> None:
    def ridge(x: Array, y: Array) -> Array:
        return 80.0 * np.exp(-np.square(x) / 150.0**2)

    tunnel = {**STREET, "tunnel": "yes"}
    osm = drawn_map(
        NODES,
        [
            (1, [6, 3], STREET),
            (2, [3, 0], tunnel),
            (7, [0, 1], tunnel),
            (3, [1, 5], STREET),
            (4, [2, 0, 4], STREET),
        ],
    )
    world = world_on(ridge, osm)

    apart = [note for note in world.notes if "joins what does not meet" in note]
    known = {profile.id for profile in elevation_of(world).connections}
    assert apart
    assert len(known) == len(world.connections) - len(apart)


def test_where_the_model_ends_inside_a_world_the_world_says_so() -> None:
    def half(x: Array, y: Array) -> Array:
        return np.where(y > 10.0, 50.0, np.nan)

    notes = world_on(half).notes

    (told,) = [note for note in notes if "knows no height of" in note]
    assert 40 < int(told.split()[7]) < 60
    assert not any("knows no height" in note for note in world_on(east).notes)
