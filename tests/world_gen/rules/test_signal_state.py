"""What lights show: by the plan, and as heard live."""

from __future__ import annotations

from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st

from foretwin.contracts.signals import SignalGroup, SignalPhase, SignalPlan
from foretwin.world_gen.rules.signal_state import (
    LiveColour,
    colours_at,
    cycle_s,
    world_colours_at,
)
from tests.world_gen.drawn_maps import crossing, world_of

COVERS = ("foretwin.contracts.signals",)
PLAN = SignalPlan(
    groups=(
        SignalGroup(id="w", connection_ids=("1",)),
        SignalGroup(id="n", connection_ids=("2",)),
        SignalGroup(id="foot", connection_ids=(), crossing_ids=("c",)),
    ),
    phases=(
        SignalPhase(green_s=20.0, green_group_ids=("w", "foot")),
        SignalPhase(green_s=10.0, green_group_ids=("n",)),
    ),
    amber_s=3.0,
    all_red_s=2.0,
    source="default",
)


@pytest.mark.parametrize(
    ("time_s", "west", "north", "foot"),
    [
        (0.0, "green", "red", "green"),
        (19.9, "green", "red", "green"),
        (20.0, "amber", "red", "red"),
        (23.0, "red", "red", "red"),
        (25.0, "red", "green", "red"),
        (35.0, "red", "amber", "red"),
        (39.0, "red", "red", "red"),
        (40.0, "green", "red", "green"),
        (-5.0, "red", "amber", "red"),
    ],
)
def test_a_plan_runs_through_its_phases(time_s, west, north, foot):
    assert cycle_s(PLAN) == 40.0
    assert colours_at(PLAN, time_s) == {"w": west, "n": north, "foot": foot}


def test_a_group_of_two_phases_in_a_row_stays_green():
    both = SignalPlan(
        groups=PLAN.groups,
        phases=(
            SignalPhase(green_s=10.0, green_group_ids=("w",)),
            SignalPhase(green_s=10.0, green_group_ids=("w", "foot")),
            SignalPhase(green_s=10.0, green_group_ids=("n",)),
        ),
        amber_s=3.0,
        all_red_s=2.0,
        source="default",
    )
    assert {colours_at(both, t / 4)["w"] for t in range(100)} == {"green"}
    assert colours_at(both, 25.0)["w"] == "amber"


def test_what_is_heard_counts_until_it_is_old():
    live = {
        "w": LiveColour(2.0, "dark"),
        "elsewhere": LiveColour(2.0, "green"),
        "n": LiveColour(2.0, "unknown"),
    }
    assert colours_at(PLAN, 4.0, live) == {"w": "dark", "n": "red", "foot": "green"}
    assert colours_at(PLAN, 4.1, live)["w"] == "green"


@given(
    greens=st.lists(st.floats(5.0, 60.0), min_size=1, max_size=5),
    amber_s=st.floats(3.0, 5.0),
    all_red_s=st.floats(0.5, 8.0),
    start_s=st.floats(-500.0, 500.0),
)
def test_one_group_at_a_time_and_amber_after_green(greens, amber_s, all_red_s, start_s):
    plan = SignalPlan(
        groups=tuple(SignalGroup(id=str(i), connection_ids=("c",)) for i in range(len(greens))),
        phases=tuple(
            SignalPhase(green_s=green_s, green_group_ids=(str(i),))
            for i, green_s in enumerate(greens)
        ),
        amber_s=amber_s,
        all_red_s=all_red_s,
        source="default",
    )
    steps = [colours_at(plan, start_s + 0.25 * k) for k in range(int(4 * cycle_s(plan)) + 8)]
    for now in steps:
        assert sum(colour != "red" for colour in now.values()) <= 1
    for now, later in pairwise(steps):
        for name, colour in now.items():
            after = {
                "green": ("green", "amber"),
                "amber": ("amber", "red"),
                "red": ("red", "green"),
            }
            assert len(greens) == 1 or later[name] in after[colour]
    assert all("green" in {now[group.id] for now in steps} for group in plan.groups)


def test_a_world_shows_all_its_lights():
    world = world_of(crossing(node_tags={0: {"highway": "traffic_signals"}}))
    colours = world_colours_at(world, 1.0)
    assert set(colours) == {signal.group_id for signal in world.signals}
    assert sorted(colours.values()) == ["green", "green", "red", "red"]
