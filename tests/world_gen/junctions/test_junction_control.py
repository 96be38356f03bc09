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
