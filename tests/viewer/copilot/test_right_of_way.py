"""What the junction ahead asks of the car, by the lane that it takes."""

from __future__ import annotations

from collections.abc import Sequence

import msgspec
import numpy as np
import pytest

from foretwin.contracts.world import Conflict, World, YieldRule
from foretwin.viewer.copilot.right_of_way import RightOfWay, of_junction, right_of_way
from tests.viewer.drawn_junction import LANE_M, junction

ID = "x1"
STRAIGHT = np.array([[-60.0, -LANE_M / 2.0], [60.0, -LANE_M / 2.0]])
SHORT = STRAIGHT.copy()
SHORT[1, 0] = -30.0


def drawn(
    *controls: str, rules: Sequence[YieldRule] = (), side: str = "right", group: str | None = None
) -> World:
    """Return the drawn crossing; its connections, straight on and left, have these controls."""
    world = junction()
    connections = tuple(
        msgspec.structs.replace(one, control=control, junction_id=ID, signal_group_id=group)
        for one, control in zip(world.connections, controls, strict=True)
    )
    conflicts = tuple(
        Conflict(
            first_id="w_e",
            second_id="other",
            kind="crossing",
            point=np.zeros(2),
            area=np.zeros((3, 2)),
            yields_id="w_e",
            rule=rule,
            source="inferred",
        )
        for rule in rules
    )
    summary = msgspec.structs.replace(world.intersection, driving_side=side)
    return msgspec.structs.replace(
        world, connections=connections, conflicts=conflicts, intersection=summary
    )


@pytest.mark.parametrize(
    ("control", "rules", "side", "said"),
    [
        ("stop", (), "right", "stop"),
        ("give_way", (), "right", "give way"),
        ("none", ("lesser_road",), "right", "give way"),
        ("none", ("near_side", "turn_across"), "right", "right before left"),
        ("none", ("near_side",), "left", "left before right"),
        ("none", ("turn_across",), "right", "oncoming first"),
        ("none", ("merge_order",), "right", "give way"),
        ("none", (), "right", "right of way"),
    ],
)
def test_it_says_who_waits(control: str, rules: Sequence[YieldRule], side: str, said: str) -> None:
    found = right_of_way(drawn(control, "stop", rules=rules, side=side), ID, STRAIGHT)
    assert found is not None
    assert found.text == said


def test_a_light_has_its_group_by_which_its_colour_is_known() -> None:
    found = right_of_way(drawn("signal", "none", group="g1"), ID, STRAIGHT)
    assert found == RightOfWay("signals", "signals", "g1")


def test_before_a_roundabout_counts_the_way_in_not_the_ring_that_follows() -> None:
    world = drawn("give_way", "stop")
    way_in = msgspec.structs.replace(
        world.connections[0], centerline=np.array([[-12.0, -2.5], [-8.0, -1.0], [-4.0, -1.75]])
    )
    ring = msgspec.structs.replace(
        way_in, id="ring", control="none", centerline=np.array([[-4.0, -1.75], [12.0, -1.75]])
    )
    round_it = msgspec.structs.replace(world, connections=(ring, way_in, world.connections[1]))
    assert right_of_way(round_it, ID, STRAIGHT) == RightOfWay("give_way", "give way")


def test_before_the_path_reaches_the_junction_it_counts_what_all_ways_on_have_in_common() -> None:
    assert right_of_way(drawn("stop", "stop"), ID, SHORT) == RightOfWay("stop", "stop")
    assert right_of_way(drawn("stop", "give_way"), ID, SHORT) is None
    assert right_of_way(drawn("signal", "signal", group="g1"), ID, SHORT) == RightOfWay(
        "signals", "signals", "g1"
    )


def test_another_junction_another_lane_and_the_other_way_are_not_taken_for_it() -> None:
    world = drawn("stop", "stop")
    assert right_of_way(world, "elsewhere", STRAIGHT) is None
    assert right_of_way(world, ID, STRAIGHT[::-1]) is None
    assert right_of_way(world, ID, SHORT[::-1]) is None
    assert right_of_way(world, ID, SHORT + np.array([0.0, 9.0])) is None
    assert right_of_way(world, ID, STRAIGHT[:1]) is None


def test_of_the_whole_junction_its_control_is_known() -> None:
    assert of_junction("give_way") == RightOfWay("give_way", "give way")
    assert of_junction(None).text == ""
