"""Classes of roads rank as drivers know them."""

from __future__ import annotations

from foretwin.world_gen.roads.road_classes import (
    CAR_CLASSES,
    OTHER_CLASSES,
    ROAD_CLASSES,
    road_class,
)

YARDS = {"living_street"}


def test_links_rank_below_every_street_but_a_yard() -> None:
    links = {name for name in ROAD_CLASSES if name.endswith("_link")}
    streets = {ROAD_CLASSES[name].importance for name in CAR_CLASSES - links - YARDS}
    yards = {ROAD_CLASSES[name].importance for name in YARDS}
    assert all(max(yards) < ROAD_CLASSES[name].importance < min(streets) for name in links)


def test_roads_for_cars_and_others_are_told_apart() -> None:
    assert {"pedestrian", "service", "track", "busway"} == OTHER_CLASSES
    assert not CAR_CLASSES & OTHER_CLASSES


def test_of_an_unknown_class_nothing_special_is_usual() -> None:
    assert road_class("corridor") == (50.0, None, 2.0, True)
