"""How fast one may drive by signs, zones, and a country's rules."""

from __future__ import annotations

import pytest

from foretwin.world_gen.roads.speed_limits import in_town, speed_limit

MPH = 1.609344


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
        ({"maxspeed:forward": "50", "maxspeed:backward": "70"}, 50.0, "tagged"),
        ({"maxspeed": "60", "maxspeed:backward": "30"}, 60.0, "tagged"),
        ({"maxspeed:backward": "70"}, 70.0, "inferred"),
        ({"maxspeed:backward": "70", "zone:traffic": "DE:urban"}, 50.0, "inferred"),
        ({"maxspeed:forward": "none", "maxspeed:backward": "100"}, 130.0, "inferred"),
        ({"maxspeed": "50;30"}, 50.0, "tagged"),
        ({"maxspeed": "fast", "highway": "residential"}, 30.0, "default"),
        ({"maxspeed": "urban"}, 50.0, "inferred"),
        ({"maxspeed": "0", "highway": "secondary", "name": "High Street"}, 50.0, "default"),
    ],
)
def test_speed_limit(tags: dict[str, str], km_per_h: float, source: str) -> None:
    limit = speed_limit(tags)
    assert limit.value * 3.6 == pytest.approx(km_per_h, abs=0.01)
    assert limit.source == source


@pytest.mark.parametrize(
    ("tags", "km_per_h", "source"),
    [
        ({"maxspeed": "50"}, 50.0, "tagged"),
        ({"maxspeed:forward": "50", "maxspeed:backward": "70"}, 70.0, "tagged"),
        ({"maxspeed": "60", "maxspeed:backward": "30"}, 30.0, "tagged"),
        ({"maxspeed": "60", "maxspeed:forward": "30"}, 60.0, "tagged"),
        (
            {"source:maxspeed:backward": "DE:rural", "source:maxspeed": "DE:urban"},
            100.0,
            "inferred",
        ),
    ],
)
def test_the_other_direction_has_a_limit_of_its_own(
    tags: dict[str, str], km_per_h: float, source: str
) -> None:
    limit = speed_limit(tags, reverse=True)
    assert limit.value * 3.6 == pytest.approx(km_per_h, abs=0.01)
    assert limit.source == source


@pytest.mark.parametrize(
    ("country", "tags", "km_per_h"),
    [
        ("US", {"highway": "residential"}, 25 * MPH),
        ("US", {"highway": "secondary", "name": "Lamar Boulevard"}, 30 * MPH),
        ("US", {"highway": "secondary", "ref": "FM 969"}, 55 * MPH),
        ("DE", {"highway": "residential"}, 30.0),
        ("DE", {"highway": "secondary", "name": "Hauptstraße"}, 50.0),
        ("DE", {"highway": "secondary", "ref": "L 3173"}, 100.0),
        ("DE", {"highway": "motorway"}, 130.0),
        ("LI", {"highway": "residential"}, 50.0),
        ("LI", {"highway": "primary", "ref": "28"}, 80.0),
        ("FR", {"highway": "trunk"}, 80.0),
        ("FR", {"highway": "trunk", "motorroad": "yes"}, 110.0),
        ("FR", {"highway": "living_street"}, 20.0),
        ("GB", {"highway": "trunk", "oneway": "yes"}, 70 * MPH),
        ("GB", {"highway": "trunk"}, 60 * MPH),
        ("GB", {"highway": "trunk", "lit": "yes"}, 30 * MPH),
        ("PR", {"highway": "residential"}, 25 * MPH),
        ("", {"highway": "residential"}, 30.0),
        ("US", {"highway": "service"}, 10.0),
    ],
)
def test_without_a_sign_the_country_s_rule_holds(
    country: str, tags: dict[str, str], km_per_h: float
) -> None:
    limit = speed_limit(tags, country)
    assert limit.value * 3.6 == pytest.approx(km_per_h)
    assert limit.source == "default"


def test_a_zone_is_that_of_the_country_it_names_else_of_the_place() -> None:
    assert speed_limit({"maxspeed": "FR:rural"}, "DE").value * 3.6 == pytest.approx(80.0)
    assert speed_limit({"zone:traffic": "rural"}, "FR").value * 3.6 == pytest.approx(80.0)
    assert speed_limit({"maxspeed": "DE:motorway"}, "FR").value * 3.6 == pytest.approx(130.0)


def test_between_towns_a_road_has_a_number_and_no_name() -> None:
    road = {"highway": "secondary", "ref": "L 3173"}
    assert not in_town(road)
    assert in_town({**road, "lit": "yes"})
    assert in_town({**road, "name": "Dippelstraße"})
    assert not in_town({**road, "name": "Hohe Straße", "lit": "no"})
    assert in_town({**road, "junction": "roundabout"}), "rings have no names anywhere"
    assert in_town({"highway": "unclassified"})
    assert not in_town({"highway": "motorway", "name": "Ostring"})
