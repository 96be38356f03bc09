"""Stop lines of lanes that begin behind them, and their lights, in every export that has lanes."""

from __future__ import annotations

import math
from pathlib import Path

import msgspec
import numpy as np
import pytest

from foretwin.contracts.provenance import Choice
from foretwin.contracts.signals import Signal
from foretwin.contracts.world import StopLine, World
from foretwin.world_gen.export.stop_line_lanes import StopLineLanes
from tests.world_gen.export import drawn_world
from tests.world_gen.export.lanelet2_file import written as written_lanelet2
from tests.world_gen.export.test_commonroad import lanelets, line_of, refs
from tests.world_gen.export.test_commonroad import written as written_commonroad
from tests.world_gen.export.test_opendrive import written as written_opendrive

LINE_X_M = 45.0
"""The lane `short`, of 10 m, begins 5 m behind its line."""


def parted(control: str = "signal") -> World:
    """A road that the map parts between a line and the junction that it is for."""
    far = drawn_world.road("far", [[0, 0], [50, 0]], ahead=[3.0])
    short = drawn_world.road("short", [[50, 0], [60, 0]], ahead=[3.0])
    line = StopLine(
        id="line",
        lane_id="short.f0",
        ends=np.array([[LINE_X_M, 0.0], [LINE_X_M, -3.0]]),
        control=Choice(control, "tagged"),
    )
    head = Signal(
        id="head",
        osm_node=None,
        group_id="g",
        lane_ids=("short.f0",),
        position=np.array([LINE_X_M, -3.6, 3.0]),
        yaw_rad=math.pi,
        source="tagged",
    )
    return drawn_world.world(
        (
            msgspec.structs.replace(far[0], to_place="p"),
            drawn_world.leading_to(far[1], {"far.f0": "short.f0"}),
        ),
        (msgspec.structs.replace(short[0], from_place="p"), short[1]),
        stop_lines=(line,),
        signals=(head,) if control == "signal" else (),
    )


def test_a_line_lies_across_its_lane_or_the_one_before() -> None:
    drawn = parted()
    (line,), (head,) = drawn.stop_lines, drawn.signals
    assert StopLineLanes(drawn).across(line) == "far.f0"
    assert StopLineLanes(drawn).of_head(head, "short.f0") == "far.f0"
    nearer = msgspec.structs.replace(line, ends=line.ends + np.array([10.0, 0.0]))
    there = msgspec.structs.replace(drawn, stop_lines=(nearer,))
    assert StopLineLanes(there).across(nearer) == "short.f0"


@pytest.mark.parametrize("control", ["signal", "give_way"])
def test_opendrive_has_them_where_the_world_has(control: str, tmp_path: Path) -> None:
    file = written_opendrive(parted(control), tmp_path)
    (signal,), (paint,) = file.root.iter("signal"), file.root.iter("object")
    for item in (signal, paint):
        road = file.roads[item.getparent().getparent().get("id")]
        x_m, _ = road.beside(float(item.get("s")), float(item.get("t")))
        assert (road.source, x_m) == ("far", pytest.approx(LINE_X_M, abs=0.3))


def test_commonroad_has_them_on_the_lanelet_that_they_lie_across(tmp_path: Path) -> None:
    far, short = lanelets(written_commonroad(parted(), tmp_path)).values()
    assert [x for x, _ in line_of(far.find("stopLine"))] == [LINE_X_M, LINE_X_M]
    assert len(refs(far, "trafficLightRef")) == 1
    assert short.find("stopLine") is None
    assert not refs(short, "trafficLightRef")


def test_lanelet2_lets_the_lanelet_before_name_the_light(tmp_path: Path) -> None:
    found = written_lanelet2(parted(), tmp_path)
    ((rule, _, _),) = found.rules("traffic_light")
    member = ("relation", rule, "regulatory_element")
    assert member in found.lanelet("far.f0")[0]
    assert member not in found.lanelet("short.f0")[0]
