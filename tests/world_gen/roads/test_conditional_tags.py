"""What a World says of roads that are closed, or one way, under a condition."""

from __future__ import annotations

import pytest

from tests.world_gen.drawn_maps import STREET, crossing, world_of


@pytest.mark.parametrize(
    "condition",
    [
        {"motor_vehicle:backward:conditional": "no @ (07:00-10:00, 16:00-19:00)"},
        {"access:conditional": "no @ (22:00-06:00)"},
        {"oneway:conditional": "yes @ (Mo-Fr)"},
    ],
)
def test_a_world_names_the_conditions_that_close_its_roads_at_times(
    condition: dict[str, str],
) -> None:
    plain, world = world_of(crossing()), world_of(crossing(street=STREET | condition))
    ((key, value),) = condition.items()

    assert [lane.id for lane in world.lanes] == [lane.id for lane in plain.lanes]
    assert set(world.notes) - set(plain.notes) == {
        f"way {way}: {key}={value}: whether that holds is not known; here it does not"
        for way in (11, 13)
    }


@pytest.mark.parametrize(
    "condition",
    [
        {"access:conditional": "yes @ agricultural"},
        {"maxspeed:conditional": "30 @ (22:00-06:00)"},
        {"bus:conditional": "no @ (22:00-06:00)"},
    ],
)
def test_a_condition_that_closes_nothing_to_cars_is_no_note(condition: dict[str, str]) -> None:
    world = world_of(crossing(street=STREET | condition))

    assert not [note for note in world.notes if "conditional" in note]
