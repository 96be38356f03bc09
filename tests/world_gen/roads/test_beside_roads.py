"""Sidewalks, crossings drawn as ways, tram tracks and islands, as the map tells of them."""

from __future__ import annotations

import numpy as np
import pytest
from shapely.geometry import LineString, Point, Polygon

from foretwin.world_gen.ground.sidewalks import sides_with_sidewalk
from foretwin.world_gen.roads.beside_roads import BesideIndex
from tests.world_gen.drawn_maps import STREET, crossing, world_of


@pytest.mark.parametrize(
    ("tags", "sides"),
    [
        ({}, ()),
        ({"sidewalk": "both"}, ("left", "right")),
        ({"sidewalk": "right"}, ("right",)),
        ({"sidewalk": "separate"}, ()),
        ({"sidewalk": "no"}, ()),
        ({"sidewalk:left": "yes", "sidewalk:right": "separate"}, ("left",)),
        ({"sidewalk:both": "yes", "sidewalk:left": "no"}, ("right",)),
    ],
)
def test_where_a_sidewalk_belongs_to_the_road(tags, sides):
    assert sides_with_sidewalk(tags) == sides


def test_a_sidewalk_lies_beside_the_kerb_and_on_no_carriageway():
    world = world_of(crossing(street=STREET | {"sidewalk": "both", "sidewalk:both:width": "3"}))
    assert len(world.sidewalks) == 4
    assert {area.source for area in world.sidewalks} == {"tagged"}
    roads = [Polygon(area.outline, area.holes) for area in world.road_surface]
    for area in world.sidewalks:
        strip = Polygon(area.outline)
        assert strip.is_valid
        assert 3.0 * 80.0 < strip.area < 3.0 * 100.0
        assert sum(strip.intersection(road).area for road in roads) < 0.1
        assert np.abs(area.outline[:, 1]).min() == pytest.approx(3.0, abs=0.01)


def test_a_sidewalk_of_its_own_keeps_its_place():
    osm = crossing(
        street=STREET | {"sidewalk": "separate"},
        extra_nodes={30: (-90.0, 8.0), 31: (90.0, 8.0)},
        extra_ways=[(30, [30, 31], {"highway": "footway", "footway": "sidewalk"})],
    )
    walks = world_of(osm).sidewalks
    # The avenue cuts it in two.
    assert [area.id for area in walks] == ["sidewalk:w30", "sidewalk:w30-1"]
    assert all(7.0 <= y <= 9.0 for area in walks for y in np.round(area.outline[:, 1], 2))


def test_what_lies_elsewhere_on_the_map_is_not_looked_at():
    walk = {"highway": "footway", "footway": "sidewalk"}
    osm = crossing(
        extra_nodes={30: (-90.0, 8.0), 31: (90.0, 8.0), 32: (5000.0, 8.0), 33: (5100.0, 8.0)},
        extra_ways=[(30, [30, 31], walk), (31, [32, 33], walk)],
    )
    index = BesideIndex(osm)
    assert [way.id for way in index.within(Point(0.0, 0.0).buffer(50.0)).sidewalks] == [30]
    assert [way.id for way in index.within(Point(5050.0, 0.0).buffer(50.0)).sidewalks] == [31]


def test_a_way_that_crosses_a_road_is_a_crossing():
    osm = crossing(
        street=STREET,
        extra_nodes={30: (40.0, 12.0), 31: (40.0, 0.0), 32: (40.0, -12.0)},
        extra_ways=[
            (15, [0, 31], STREET),
            (
                30,
                [30, 31, 32],
                {
                    "highway": "footway",
                    "footway": "crossing",
                    "crossing": "zebra",
                    "crossing:island": "yes",
                },
            ),
        ],
    )
    (found,) = world_of(osm).crossings
    assert (found.osm_node, found.kind.value, found.kind.source) == (31, "zebra", "tagged")
    assert found.island


def test_tram_tracks_are_lanes_that_no_car_drives_on():
    osm = crossing(
        extra_nodes={30: (-60.0, -60.0), 31: (60.0, 60.0)},
        extra_ways=[(30, [30, 0, 31], {"railway": "tram"})],
    )
    world = world_of(osm)
    (track,) = (lane for lane in world.lanes if lane.kind == "tram")
    assert LineString(track.centerline).length == pytest.approx(169.7, abs=0.1)
    (road,) = (road for road in world.roads if road.id == track.road_id)
    assert (road.road_class, road.lane_ids, road.from_place) == ("tram", (track.id,), None)
    assert not any(track.id in (c.from_lane_id, c.to_lane_id) for c in world.connections)
    assert any("crossed by a tram line, way 30" in note for note in world.notes)


def test_a_mapped_island_stands_where_nobody_drives():
    square = {30: (20.0, -6.0), 31: (26.0, -6.0), 32: (26.0, 0.0), 33: (20.0, 0.0)}
    osm = crossing(
        extra_nodes=square,
        extra_ways=[(30, [30, 31, 32, 33, 30], {"area:highway": "traffic_island"})],
    )
    (island,) = (area for area in world_of(osm).islands if area.id.endswith("w30"))
    assert island.source == "tagged"
    # Half of it would stand on a lane.
    assert island.outline[:, 1].max() == pytest.approx(-3.0, abs=0.01)
