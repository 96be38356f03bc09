"""What tags say to a driver."""

from __future__ import annotations

import pytest

from foretwin.contracts.provenance import Quantity
from foretwin.world_gen.osm.driving_side import side_at
from foretwin.world_gen.roads.road_tags import (
    directions,
    lane_counts,
    open_to_cars,
    road_layer,
    speed_limit,
)

COVERS = ("foretwin.world_gen.osm.driving_side",)


@pytest.mark.parametrize(
    ("tags", "expected"),
    [
        ({"highway": "residential"}, (True, True)),
        ({"highway": "residential", "oneway": "yes"}, (True, False)),
        ({"highway": "residential", "oneway": "-1"}, (False, True)),
        ({"highway": "motorway"}, (True, False)),
        ({"highway": "motorway", "oneway": "no"}, (True, True)),
        ({"highway": "tertiary", "junction": "roundabout"}, (True, False)),
        ({"highway": "residential", "access": "private"}, (False, False)),
        ({"highway": "residential", "access": "no", "motor_vehicle": "destination"}, (True, True)),
        ({"highway": "residential", "motor_vehicle": "no"}, (False, False)),
        ({"highway": "pedestrian"}, (False, False)),
        ({"highway": "pedestrian", "motor_vehicle": "delivery"}, (True, True)),
        ({"highway": "service"}, (True, True)),
        ({"highway": "residential", "vehicle:backward": "no"}, (True, False)),
        ({"highway": "residential", "oneway": "yes", "oneway:bicycle": "no"}, (True, False)),
    ],
)
def test_directions(tags: dict[str, str], expected: tuple[bool, bool]) -> None:
    assert tuple(directions(tags)) == expected


def test_farm_and_forest_roads_are_closed_unless_another_use_is_named() -> None:
    assert not open_to_cars({"highway": "track", "vehicle": "agricultural;forestry"})
    assert open_to_cars({"highway": "track", "vehicle": "agricultural;destination"})


@pytest.mark.parametrize(
    ("tags", "km_per_h", "source"),
    [
        ({"maxspeed": "50"}, 50.0, "tagged"),
        ({"maxspeed": "30 mph"}, 48.28032, "tagged"),
        ({"maxspeed": "DE:urban"}, 50.0, "inferred"),
        ({"source:maxspeed": "DE:rural"}, 100.0, "inferred"),
        ({"source:maxspeed": "FR:rural"}, 80.0, "inferred"),
        ({"maxspeed:type": "DE:zone30"}, 30.0, "inferred"),
        ({"maxspeed": "walk"}, 7.0, "inferred"),
        ({"maxspeed": "none"}, 130.0, "inferred"),
        ({"maxspeed": "signals", "maxspeed:forward": "80"}, 80.0, "tagged"),
        ({"maxspeed:forward": "70", "maxspeed:backward": "50"}, 70.0, "tagged"),
        ({"maxspeed": "50;30"}, 50.0, "tagged"),
        ({"maxspeed": "fast", "highway": "residential"}, 30.0, "default"),
        ({"maxspeed": "0", "highway": "secondary"}, 50.0, "default"),
    ],
)
def test_speed_limit(tags: dict[str, str], km_per_h: float, source: str) -> None:
    limit = speed_limit(tags)
    assert limit.value * 3.6 == pytest.approx(km_per_h, abs=0.01)
    assert limit.source == source


@pytest.mark.parametrize(
    ("tags", "forward", "backward"),
    [
        ({}, (1.0, "default"), (1.0, "default")),
        ({"lanes": "2"}, (1.0, "inferred"), (1.0, "inferred")),
        ({"lanes": "3"}, (2.0, "inferred"), (1.0, "inferred")),
        ({"lanes": "3", "lanes:forward": "1"}, (1.0, "tagged"), (2.0, "inferred")),
        ({"lanes": "3", "lanes:both_ways": "1"}, (1.0, "inferred"), (1.0, "inferred")),
        ({"lanes": "2", "oneway": "yes"}, (2.0, "tagged"), (0.0, "inferred")),
        ({"lanes": "2", "oneway": "-1"}, (0.0, "inferred"), (2.0, "tagged")),
        ({"oneway": "yes", "turn:lanes": "left|right"}, (2.0, "inferred"), (0.0, "inferred")),
        ({"turn:lanes:backward": "left|through"}, (1.0, "default"), (2.0, "inferred")),
        ({"lanes": "many"}, (1.0, "default"), (1.0, "default")),
    ],
)
def test_lane_counts(
    tags: dict[str, str], forward: tuple[float, str], backward: tuple[float, str]
) -> None:
    tags = {"highway": "residential", **tags}
    lanes = lane_counts(tags, directions(tags))
    assert lanes == (Quantity(*forward), Quantity(*backward))  # type: ignore[arg-type]


def test_layers() -> None:
    assert road_layer({"layer": "-2"}) == -2
    assert road_layer({"bridge": "yes"}) == 1
    assert road_layer({"tunnel": "yes"}) == -1
    assert road_layer({"tunnel": "building_passage", "layer": "ground"}) == 0


@pytest.mark.parametrize(
    ("place", "lat", "lon", "side"),
    [
        ("Manchester", 53.45, -2.3, "left"),
        ("Dublin", 53.35, -6.26, "left"),
        ("Dover", 51.13, 1.31, "left"),
        ("Calais", 50.95, 1.86, "right"),
        ("Jersey", 49.2, -2.1, "left"),
        ("Cherbourg", 49.63, -1.6, "right"),
        ("Tokyo", 35.7, 139.7, "left"),
        ("Naha", 26.2, 127.7, "left"),
        ("Seoul", 37.6, 127.0, "right"),
        ("Busan", 35.1, 129.0, "right"),
        ("Sydney", -33.9, 151.2, "left"),
        ("Auckland", -36.8, 174.8, "left"),
        ("Delhi", 28.6, 77.2, "left"),
        ("Karachi", 24.9, 67.0, "left"),
        ("Kabul", 34.5, 69.2, "right"),
        ("Dhaka", 23.8, 90.4, "left"),
        ("Kathmandu", 27.7, 85.3, "left"),
        ("Colombo", 6.9, 79.9, "left"),
        ("Bangkok", 13.75, 100.5, "left"),
        ("Phnom Penh", 11.6, 104.9, "right"),
        ("Yangon", 16.8, 96.2, "right"),
        ("Singapore", 1.35, 103.8, "left"),
        ("Jakarta", -6.2, 106.8, "left"),
        ("Manila", 14.6, 121.0, "right"),
        ("Hong Kong", 22.3, 114.2, "left"),
        ("Shenzhen", 22.6, 114.1, "right"),
        ("Johannesburg", -26.2, 28.0, "left"),
        ("Windhoek", -22.6, 17.1, "left"),
        ("Nairobi", -1.3, 36.8, "left"),
        ("Kampala", 0.3, 32.6, "left"),
        ("Addis Ababa", 9.0, 38.7, "right"),
        ("Kinshasa", -4.3, 15.3, "right"),
        ("Luanda", -8.8, 13.2, "right"),
        ("Antananarivo", -18.9, 47.5, "right"),
        ("Kingston", 18.0, -76.8, "left"),
        ("Havana", 23.1, -82.4, "right"),
        ("Port-au-Prince", 18.5, -72.3, "right"),
        ("Valletta", 35.9, 14.5, "left"),
        ("Nicosia", 35.2, 33.4, "left"),
        ("Berlin", 52.5, 13.4, "right"),
        ("Paris", 48.9, 2.35, "right"),
        ("San Francisco", 37.8, -122.4, "right"),
        ("Toronto", 43.7, -79.4, "right"),
        ("Oslo", 59.9, 10.7, "right"),
        ("Brest", 48.4, -4.5, "right"),
    ],
)
def test_side_of_the_road(place: str, lat: float, lon: float, side: str) -> None:
    assert side_at(lat, lon) == side, place
