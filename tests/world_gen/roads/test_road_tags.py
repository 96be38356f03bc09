"""What tags say to a driver."""

from __future__ import annotations

import pytest

from foretwin.contracts.provenance import Quantity
from foretwin.world_gen.roads.road_tags import (
    below_buildings,
    directions,
    is_crossed,
    lane_counts,
    open_to_cars,
    road_layer,
)


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
    ("tags", "below"),
    [
        ({}, False),
        ({"tunnel": "no", "covered": "no", "layer": "1", "bridge": "yes"}, False),
        ({"tunnel": "building_passage"}, True),
        ({"covered": "arcade"}, True),
        ({"layer": "-1"}, True),
    ],
)
def test_what_leads_below_buildings(tags: dict[str, str], below: bool) -> None:
    assert below_buildings(tags) == below


@pytest.mark.parametrize(
    ("tags", "crossed"),
    [
        ({"highway": "crossing"}, True),
        ({"highway": "crossing", "crossing": "unmarked"}, True),
        ({"highway": "crossing", "crossing": "no"}, False),
        ({"highway": "traffic_signals"}, False),
        ({"highway": "traffic_signals", "crossing": "traffic_signals"}, True),
        ({"highway": "traffic_signals", "crossing": "no"}, False),
    ],
)
def test_where_people_cross_on_foot(tags: dict[str, str], crossed: bool) -> None:
    assert is_crossed(tags) is crossed
