"""What a World says of its level crossings."""

from __future__ import annotations

import pytest

from tests.world_gen.drawn_maps import AVENUE, CROSS, STREET, Tags, drawn_map, world_of

RAILS = 20
NOT_HELD = "the World holds no stop line, light or barrier before its rails"


def notes_of(tags: Tags, *, road: Tags = STREET) -> list[str]:
    """Return the notes on a node of the road east of a crossing, 60 m from it."""
    ways = [
        (11, [0, RAILS, 1], road),
        (12, [0, 2], AVENUE),
        (13, [3, 0], STREET),
        (14, [4, 0], AVENUE),
    ]
    world = world_of(drawn_map(CROSS | {RAILS: (60.0, 0.0)}, ways, node_tags={RAILS: tags}))
    return [note for note in world.notes if note.startswith(f"node {RAILS}: ")]


@pytest.mark.parametrize(
    ("tags", "told"),
    [
        ({}, ""),
        ({"crossing:barrier": "no"}, " (crossing:barrier=no)"),
        (
            {"crossing:barrier": "half", "crossing:light": "yes"},
            " (crossing:barrier=half, crossing:light=yes)",
        ),
    ],
)
def test_a_level_crossing_is_named_with_what_guards_it(tags: Tags, told: str) -> None:
    found = notes_of({"railway": "level_crossing", **tags})
    assert found == [f"node {RAILS}: level crossing{told}; {NOT_HELD}"]


def test_where_people_cross_rails_on_foot_is_no_level_crossing() -> None:
    assert notes_of({"railway": "crossing"}) == []


def test_the_rails_of_a_road_closed_to_cars_are_not_named() -> None:
    tags = {**STREET, "motor_vehicle": "no"}
    assert notes_of({"railway": "level_crossing"}, road=tags) == []
