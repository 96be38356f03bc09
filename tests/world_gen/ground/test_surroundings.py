"""What lies on the ground of a World: every part in its place, and none on another."""

from __future__ import annotations

import numpy as np
import pytest
import shapely

from foretwin.contracts.world import Area, World
from tests.world_gen.drawn_maps import STREET, crossing, roundabout, world_of

COVERS = (
    "foretwin.world_gen.ground.crossings",
    "foretwin.world_gen.ground.islands",
    "foretwin.world_gen.ground.road_surface",
    "foretwin.world_gen.ground.sidewalks",
    "foretwin.world_gen.polygon_areas",
)


def covered(areas: tuple[Area, ...]) -> shapely.Geometry:
    return shapely.union_all([shapely.Polygon(a.outline, a.holes) for a in areas])


@pytest.fixture(scope="module")
def world() -> World:
    square = {30: (40.0, -6.0), 31: (46.0, -6.0), 32: (46.0, 0.0), 33: (40.0, 0.0)}
    return world_of(
        crossing(
            street=STREET | {"sidewalk": "both"},
            extra_nodes=square | {40: (60.0, 0.0), 41: (20.0, 0.0)},
            extra_ways=[
                (30, [30, 31, 32, 33, 30], {"area:highway": "traffic_island"}),
                (15, [0, 41, 40], STREET | {"sidewalk": "both"}),
            ],
            node_tags={41: {"highway": "crossing", "crossing:signals": "yes"}},
        )
    )


def test_cars_drive_on_paved_ground_alone(world):
    ground = covered(world.road_surface).buffer(0.02)
    for way in (*world.lanes, *world.connections):
        assert ground.contains(shapely.LineString(way.centerline).buffer(0.8, cap_style="flat"))


def test_sidewalks_lie_beside_the_road(world):
    walks, ground = covered(world.sidewalks), covered(world.road_surface)
    assert walks.area > 100.0
    assert walks.intersection(ground).area < 0.1
    assert walks.distance(ground) < 0.01


def test_a_crossing_leads_from_kerb_to_kerb(world):
    (found,) = world.crossings
    assert (found.id, found.kind.value, found.kind.source) == ("n41", "traffic_signals", "tagged")
    ends = shapely.points(found.line)
    assert shapely.distance(ends, covered(world.road_surface).boundary) == pytest.approx(
        0, abs=0.01
    )


def test_islands_are_not_driven_on(world):
    (mapped,) = world.islands
    ring = world_of(roundabout())
    (middle,) = ring.islands
    assert (mapped.id, mapped.source) == ("island:traffic:w30", "tagged")
    assert (middle.id.rpartition(":")[0], middle.source) == ("island:ring", "inferred")
    for island, drawn in ((mapped, world), (middle, ring)):
        for way in (*drawn.lanes, *drawn.connections):
            path = shapely.LineString(way.centerline).buffer(0.9, cap_style="flat")
            assert path.intersection(shapely.Polygon(island.outline)).area < 0.01


def test_areas_are_on_the_grid_and_turn_counter_clockwise(world):
    for area in (*world.road_surface, *world.sidewalks, *world.islands):
        assert np.array_equal(area.outline, np.round(area.outline, 3))
        assert shapely.Polygon(area.outline).is_valid
        assert shapely.is_ccw(shapely.LinearRing(area.outline))


def test_an_arm_that_is_wider_than_the_ring_does_not_pave_its_middle():
    ground = covered(world_of(roundabout()).road_surface)
    # The ring's middle line is at 15 m, and it is 4.5 m wide.
    assert ground.intersection(shapely.Point(0.0, 0.0).buffer(12.5)).area < 0.01
