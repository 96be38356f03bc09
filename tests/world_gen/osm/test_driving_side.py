"""On which side roads are driven: by position, and by tags where these are many."""

from __future__ import annotations

import numpy as np
import pytest
import shapely

from foretwin.contracts.arrays import Array
from foretwin.contracts.world import World
from foretwin.world_gen.countries.outlines import places_of
from foretwin.world_gen.osm.driving_side import CELL_DEG, driving_sides
from tests.world_gen.drawn_maps import crossing, world_of

BERLIN, LONDON, CALAIS = (52.5, 13.4), (51.5, -0.12), (50.95, 1.86)


def sides(
    place: tuple[float, float], tags: list[str | None], *, length_m: float = 100.0
) -> list[str]:
    """Return the sides of roads of one length at one place."""
    said = [{} if side is None else {"driving_side": side} for side in tags]
    count = len(tags)
    return sides_at(said, np.array([place] * count), length_m)


def sides_at(said: list[dict[str, str]], places: Array, length_m: float = 100.0) -> list[str]:
    lengths = np.full(len(places), length_m)
    return list(driving_sides(said, places_of(places), places, lengths))


def test_without_tags_the_place_says_it() -> None:
    assert sides(BERLIN, [None, None]) == ["right", "right"]
    assert sides(LONDON, [None, None]) == ["left", "left"]
    assert sides_at([], np.zeros((0, 2))) == []


def test_a_map_across_the_channel_has_both_sides() -> None:
    assert sides_at([{}, {}], np.array([LONDON, CALAIS])) == ["left", "right"]


def test_a_stray_tag_holds_for_its_own_road_alone() -> None:
    assert sides(BERLIN, ["left", *[None] * 99]) == ["left", *["right"] * 99]
    assert sides(LONDON, ["right", *[None] * 99]) == ["right", *["left"] * 99]


def test_many_tags_hold_for_the_roads_around_them_and_not_for_those_far_away() -> None:
    said: list[dict[str, str]] = [{"driving_side": "left"}] * 20 + [{}] * 60
    places = np.array([BERLIN] * 60 + [(BERLIN[0], BERLIN[1] + 3.0 * CELL_DEG)] * 20)
    assert sides_at(said, places) == ["left"] * 60 + ["right"] * 20


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
    lines = {lane.id: shapely.LineString(lane.centerline) for lane in plain.lanes}
    # Street may end sooner, for cars to change over to the other side; it lies where it did.
    moved = {
        lane.osm_way
        for lane in stray.lanes
        if shapely.LineString(lane.centerline).hausdorff_distance(lines[lane.id]) > 10.0
        or shapely.distance(shapely.points(lane.centerline), lines[lane.id]).max() > 1e-6
    }
    assert moved == {15}


@pytest.mark.parametrize("word", ["both", "", "LEFT"])
def test_other_words_say_nothing(word: str) -> None:
    assert sides(BERLIN, [word] * 4) == ["right"] * 4
