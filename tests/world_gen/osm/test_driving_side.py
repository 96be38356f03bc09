"""On which side roads are driven: by position, and by tags where these are many."""

from __future__ import annotations

import numpy as np
import pytest

from foretwin.contracts.world import World
from foretwin.world_gen.osm.driving_side import CELL_DEG, driving_sides, side_at
from tests.world_gen.drawn_maps import crossing, world_of

BERLIN, LONDON, CALAIS = (52.5, 13.4), (51.5, -0.12), (50.95, 1.86)


def sides(
    place: tuple[float, float], tags: list[str | None], *, length_m: float = 100.0
) -> list[str]:
    """Return the sides of roads of one length at one place."""
    said = [{} if side is None else {"driving_side": side} for side in tags]
    count = len(tags)
    return list(driving_sides(said, np.array([place] * count), np.full(count, length_m)))


def test_without_tags_the_place_says_it() -> None:
    assert sides(BERLIN, [None, None]) == ["right", "right"]
    assert sides(LONDON, [None, None]) == ["left", "left"]
    assert driving_sides([], np.zeros((0, 2)), np.zeros(0)) == ()


def test_a_map_across_the_channel_has_both_sides() -> None:
    places = np.array([LONDON, CALAIS])
    assert driving_sides([{}, {}], places, np.ones(2)) == ("left", "right")


def test_a_stray_tag_holds_for_its_own_road_alone() -> None:
    assert sides(BERLIN, ["left", *[None] * 99]) == ["left", *["right"] * 99]
    assert sides(LONDON, ["right", *[None] * 99]) == ["right", *["left"] * 99]


def test_many_tags_hold_for_the_roads_around_them_and_not_for_those_far_away() -> None:
    said = [{"driving_side": "left"}] * 20 + [{}] * 60
    places = np.array([BERLIN] * 60 + [(BERLIN[0], BERLIN[1] + 3.0 * CELL_DEG)] * 20)
    found = driving_sides(said, places, np.full(80, 100.0))
    assert found == ("left",) * 60 + ("right",) * 20


def test_tags_that_disagree_are_counted_by_metres() -> None:
    said: list[str | None] = ["left", "left", "left", "right", "right", None]
    assert sides(BERLIN, said, length_m=500.0)[-1] == "left"
    assert sides(BERLIN, said[1:], length_m=500.0)[-1] == "right", "as the place says"


def test_a_few_metres_are_no_town_however_few_roads_there_are() -> None:
    assert sides(BERLIN, ["left", None]) == ["left", "right"]


def test_a_car_park_driven_on_the_left_mirrors_no_junction_beside_it() -> None:
    """It leaves the end of Street, as a ramp of 20 m."""
    ramp = {"highway": "residential"}

    def world(tags: dict[str, str]) -> World:
        return world_of(crossing(extra_nodes={5: (100.0, 20.0)}, extra_ways=[(15, [1, 5], tags)]))

    plain, stray = world(ramp), world(ramp | {"driving_side": "left"})
    assert stray.intersection == plain.intersection
    assert "way 15: traffic keeps left, around it right" in stray.notes
    lines = {lane.id: lane.centerline.tolist() for lane in plain.lanes}
    changed = {lane.osm_way for lane in stray.lanes if lane.centerline.tolist() != lines[lane.id]}
    assert changed == {15}


@pytest.mark.parametrize("word", ["both", "", "LEFT"])
def test_other_words_say_nothing(word: str) -> None:
    assert sides(BERLIN, [word] * 4) == ["right"] * 4


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
