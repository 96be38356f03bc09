"""Signs and lights near a junction, and facing it, say how it is controlled."""

from __future__ import annotations

import math
from pathlib import Path

import pytest

from tests.world_gen.sketch import Sketch, only


def signed(word: str, distances_m: dict[float, float], **tags: str) -> Sketch:
    """A crossing with a sign or light on some arms: bearing in degrees → distance."""
    sketch = Sketch()
    sketch.node(1, 0.0, 0.0)
    for arm, bearing in enumerate((0.0, 90.0, 180.0, 270.0), start=2):
        angle = math.radians(bearing)
        cos, sin = math.cos(angle), math.sin(angle)
        sketch.node(arm, 200.0 * cos, 200.0 * sin)
        nodes = [arm, 1]
        if bearing in distances_m:
            distance_m = distances_m[bearing]
            sketch.node(arm + 10, distance_m * cos, distance_m * sin, highway=word, **tags)
            nodes = [arm, arm + 10, 1]
        sketch.road(100 + arm, nodes, f"Arm {arm}")
    return sketch


@pytest.mark.parametrize(
    ("sketch", "control"),
    [
        (signed("traffic_signals", {0.0: 12.0}), "signals"),
        (signed("traffic_signals", {0.0: 35.0}), "signals"),
        (signed("traffic_signals", {0.0: 90.0}), "uncontrolled"),
        (signed("traffic_signals", {0.0: 30.0}, crossing="traffic_signals"), "uncontrolled"),
        (signed("traffic_signals", {0.0: 30.0}, crossing="no"), "signals"),
        (signed("traffic_signals", {0.0: 12.0}, direction="backward"), "uncontrolled"),
        (signed("traffic_signals", {0.0: 12.0}, direction="forward"), "signals"),
        (signed("traffic_signals", {0.0: 12.0}, crossing="traffic_signals"), "uncontrolled"),
        (signed("traffic_signals", {0.0: 1.0}, crossing="traffic_signals"), "uncontrolled"),
        (signed("traffic_signals", {0.0: 9.0, 90.0: 9.0}, crossing="traffic_signals"), "signals"),
        (signed("traffic_signals", {0.0: 9.0, 90.0: 16.0}, crossing="traffic_signals"), "signals"),
        (signed("stop", {0.0: 8.0}), "stop"),
        (signed("stop", {0.0: 8.0}, stop="all"), "all_way_stop"),
        (signed("stop", {0.0: 8.0, 90.0: 8.0, 180.0: 8.0, 270.0: 8.0}), "all_way_stop"),
        (signed("give_way", {90.0: 8.0, 270.0: 8.0}), "give_way"),
    ],
)
def test_control(sketch: Sketch, control: str, tmp_path: Path) -> None:
    assert only(sketch.junctions(tmp_path)).summary.control == control


@pytest.mark.parametrize(
    ("word", "crossing", "control"),
    [
        ("stop", "traffic_signals", "stop"),
        ("stop", "no", "signals"),
        ("", "traffic_signals", "signals"),
    ],
)
def test_light_for_those_on_foot_inside_leaves_a_junction_to_its_stop_signs(
    word: str, crossing: str, control: str, tmp_path: Path
) -> None:
    sketch = Sketch()
    for node, x_m, y_m in ((1, 0, 0), (2, 18, 0), (3, -150, 0), (4, 168, 0), (5, 0, 150)):
        sketch.node(node, x_m, y_m)
    sketch.node(6, 18.0, -150.0)
    sketch.node(7, 9.0, 0.0, highway="traffic_signals", crossing=crossing)
    sketch.node(8, 0.0, 8.0, highway=word)
    sketch.node(9, 18.0, -8.0, highway=word)
    sketch.road(101, [3, 1, 7, 2, 4], "High Street", highway="secondary")
    sketch.road(102, [5, 8, 1], "North Lane")
    sketch.road(103, [6, 9, 2], "South Lane")
    summary = only(sketch.junctions(tmp_path)).summary
    assert (summary.kind, summary.control) == ("staggered", control)


@pytest.mark.parametrize(
    ("nodes", "control"),
    [
        # A crossing lies between the light and the sign, so the sign rules.
        ({31.0: "traffic_signals", 19.0: "crossing", 9.0: "give_way"}, "give_way"),
        ({31.0: "traffic_signals", 19.0: "crossing", 9.0: "stop"}, "stop"),
        ({31.0: "traffic_signals", 19.0: "crossing"}, "signals"),
        # Nothing lies between: the sign is for when the light is off.
        ({31.0: "traffic_signals", 21.0: "give_way"}, "signals"),
        ({31.0: "traffic_signals", 26.0: "give_way", 19.0: "crossing"}, "signals"),
        # The crossing is the junction's own.
        ({13.0: "traffic_signals", 9.0: "crossing", 5.0: "give_way"}, "signals"),
    ],
)
def test_sign_behind_a_light_and_its_crossing_rules(
    nodes: dict[float, str], control: str, tmp_path: Path
) -> None:
    summary = only(_signed_lane(nodes).junctions(tmp_path)).summary
    assert summary.control == control


@pytest.mark.parametrize(
    ("street", "control"),
    [
        ({12.0: "traffic_signals"}, "signals"),
        ({20.0: "traffic_signals", 17.0: "crossing"}, "signals"),
        ({29.0: "traffic_signals"}, "signals"),
        ({29.0: "traffic_signals", 27.0: "crossing"}, "give_way"),
    ],
)
def test_lights_of_other_roads_make_a_signalled_junction_unless_they_serve_crossings(
    street: dict[float, str], control: str, tmp_path: Path
) -> None:
    lane = {31.0: "traffic_signals", 19.0: "crossing", 9.0: "give_way"}
    assert only(_signed_lane(lane, street).junctions(tmp_path)).summary.control == control


def test_a_footpath_between_light_and_sign_counts_as_a_crossing(tmp_path: Path) -> None:
    sketch = _signed_lane({38.0: "traffic_signals", 30.0: "", 8.0: "give_way"})
    sketch.node(8, -12.0, -30.0)
    sketch.way(104, [8, 21], highway="service", footway="crossing")
    (junction,) = sketch.junctions(tmp_path)
    assert (junction.summary.control, junction.lights) == ("give_way", frozenset())


def _signed_lane(lane: dict[float, str], street: dict[float, str] | None = None) -> Sketch:
    """Return a one-way lane from the south into a one-way street from the west, with nodes of
    such `highway` at metres before their meeting; those of the lane from 20 on."""
    sketch = Sketch()
    for node, x_m, y_m in ((1, 0.0, 0.0), (2, -150.0, 0.0), (3, 150.0, 0.0), (4, 0.0, -150.0)):
        sketch.node(node, x_m, y_m)
    on_lane = [
        sketch.node(20 + i, 0.0, -at_m, highway=word) for i, (at_m, word) in enumerate(lane.items())
    ]
    on_street = [
        sketch.node(40 + i, -at_m, 0.0, highway=word)
        for i, (at_m, word) in enumerate((street or {}).items())
    ]
    sketch.road(101, [2, *on_street, 1, 3], "High Street", highway="secondary", oneway="yes")
    sketch.road(102, [4, *on_lane, 1], "Slip Lane", oneway="yes")
    return sketch
