"""Lights of CommonRoad scenarios: their cycles, for which turns, and on which lanes."""

from __future__ import annotations

from collections import Counter
from itertools import pairwise
from pathlib import Path

import msgspec
import pytest
from hypothesis import given
from hypothesis import strategies as st
from lxml import etree

from foretwin.contracts.signals import SignalGroup, SignalPhase, SignalPlan
from foretwin.world_gen.export.commonroad_controls import cycle
from tests.world_gen.export.signalled import signalled_crossing
from tests.world_gen.export.test_commonroad import refs, written


def test_lights_show_the_plan_of_their_group(tmp_path: Path) -> None:
    drawn = signalled_crossing()
    root = written(drawn, tmp_path)
    seen = Counter()
    for light in root.iterfind("trafficLight"):
        shown = [
            (e.findtext("color"), int(e.findtext("duration")))
            for e in light.iterfind("cycle/cycleElement")
        ]
        assert light.findtext("active") == "true"
        assert light.findtext("direction") == "all"
        seen[tuple(shown)] += 1
    assert seen == {
        (("green", 300), ("yellow", 30), ("red", 270)): 2,  # Street: 20 + 20 + 200 + 30 after it
        (("red", 350), ("green", 200), ("yellow", 30), ("red", 20)): 2,
    }
    governed = [e for e in root.iterfind("lanelet") if refs(e, "trafficLightRef")]
    assert len(governed) == 4
    for lanelet in governed:
        assert refs(lanelet, "trafficLightRef") == refs(lanelet.find("stopLine"), "trafficLightRef")


@given(
    greens_s=st.lists(st.floats(5.0, 60.0), min_size=1, max_size=5),
    amber_s=st.floats(0.0, 5.0),
    red_amber_s=st.floats(0.0, 3.0),
    all_red_s=st.floats(0.0, 4.0),
    mine=st.data(),
)
def test_a_cycle_is_as_long_as_its_plan(
    greens_s: list[float],
    amber_s: float,
    red_amber_s: float,
    all_red_s: float,
    mine: st.DataObject,
) -> None:
    flags = [mine.draw(st.booleans()) for _ in greens_s]
    plan = SignalPlan(
        groups=(SignalGroup(id="g", connection_ids=()),),
        phases=tuple(
            SignalPhase(green_s=green, green_group_ids=("g",) if flag else ())
            for green, flag in zip(greens_s, flags, strict=True)
        ),
        amber_s=amber_s,
        red_amber_s=red_amber_s,
        all_red_s=all_red_s,
        source="default",
    )
    shown = cycle(plan, "g")
    total = sum(greens_s) + len(greens_s) * (amber_s + all_red_s)
    assert sum(e.duration_s for e in shown) == pytest.approx(total)
    green = sum(e.duration_s for e in shown if e.color == "green")
    assert green >= sum(g for g, flag in zip(greens_s, flags, strict=True) if flag) - 1e-9
    assert all(a.color != b.color for a, b in pairwise(shown))
    both = [i for i, e in enumerate(shown) if e.color == "redYellow"]
    assert all(shown[(i + 1) % len(shown)].color == "green" for i in both)


def test_a_light_away_from_junctions_shows_its_own_plan(tmp_path: Path) -> None:
    drawn = signalled_crossing()
    plans = tuple(j.plan for j in drawn.junctions if j.plan is not None)
    apart = msgspec.structs.replace(drawn, junctions=(), crossing_plans=plans)
    lights = [
        [etree.tostring(light) for light in written(one, tmp_path).iterfind("trafficLight")]
        for one in (drawn, apart)
    ]
    assert lights[0] == lights[1]


def test_a_light_stands_for_the_turns_that_obey_it(tmp_path: Path) -> None:
    drawn = signalled_crossing()
    slips = [
        msgspec.structs.replace(c, signal_group_id=None) if c.turn == "right" else c
        for c in drawn.connections
    ]
    root = written(msgspec.structs.replace(drawn, connections=tuple(slips)), tmp_path)
    directions = {light.findtext("direction") for light in root.iterfind("trafficLight")}
    assert directions == {"leftStraight"}


def test_a_light_without_a_plan_is_not_active(tmp_path: Path) -> None:
    drawn = msgspec.structs.replace(signalled_crossing(), junctions=())
    for light in written(drawn, tmp_path).iterfind("trafficLight"):
        assert light.findtext("active") == "false"
        assert light.findtext("cycle/cycleElement/color") == "inactive"
