"""A junction is what a driver takes for one."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from tests.world_gen.sketch import MANCHESTER, Sketch, off_centre_m, only, star

COVERS = (
    "foretwin.world_gen.junctions.chains",
    "foretwin.world_gen.junctions.grouping",
    "foretwin.world_gen.junctions.junction_arms",
    "foretwin.world_gen.junctions.junction_clusters",
    "foretwin.world_gen.junctions.slip_roads",
)


def dual_carriageway(sketch: Sketch, gap_m: float = 14.0) -> None:
    """An east-west street of two carriageways; nodes 11..13 eastward, 21..23 westward."""
    for node, x_m in ((11, -150.0), (12, 0.0), (13, 150.0)):
        sketch.node(node, x_m, -gap_m / 2)
        sketch.node(node + 10, -x_m, gap_m / 2)
    sketch.road(110, [11, 12, 13], "Allee", highway="secondary", oneway="yes")
    sketch.road(120, [21, 22, 23], "Allee", highway="secondary", oneway="yes")


@pytest.mark.parametrize(
    ("bearings_deg", "kind"),
    [
        ([0, 90, 180], "t_junction"),
        ([0, 60, 180], "t_junction"),
        ([0, 100, 200], "t_junction"),
        ([0, 120, 240], "y_junction"),
        ([0, 160, 200], "y_junction"),
        ([0, 90, 180, 270], "crossing"),
        ([0, 60, 130, 200, 290], "crossing"),
    ],
)
def test_roads_that_meet_in_one_node(bearings_deg: list[float], kind: str, tmp_path: Path) -> None:
    found = only(star(bearings_deg).junctions(tmp_path))
    assert found.summary.kind == kind
    assert found.summary.arms == len(bearings_deg)
    assert found.summary.id == "n1"
    assert found.summary.osm_nodes == (1,)
    assert found.summary.control == "uncontrolled"
    assert found.summary.driving_side == "right"
    assert found.radius_m == 0.0
    bearings = np.degrees([arm.bearing_rad for arm in found.arms]) % 360
    assert sorted(bearings) == pytest.approx(sorted(bearings_deg), abs=0.5)


def test_a_bend_with_another_name_is_none(tmp_path: Path) -> None:
    assert star([0, 110]).junctions(tmp_path) == ()


def test_driveways_and_footways_make_none(tmp_path: Path) -> None:
    sketch = star([0, 180])
    others = ("service", "pedestrian", "footway", "track", "busway")
    for node, highway in enumerate(others, start=50):
        sketch.node(node, 0.0, 10.0 * node)
        sketch.way(node, [1, node], highway=highway)
    sketch.node(60, 0.0, -80.0)
    sketch.road(60, [1, 60], "Private road", access="private")
    assert sketch.junctions(tmp_path) == ()


def test_a_bridge_makes_none(tmp_path: Path) -> None:
    sketch = star([0, 180])
    sketch.node(50, 0.0, 80.0)
    sketch.node(51, 0.0, -80.0)
    sketch.road(50, [50, 51], "Brücke", bridge="yes", layer="1")
    assert sketch.junctions(tmp_path) == ()


def test_two_dual_carriageways_cross_in_one_junction(tmp_path: Path) -> None:
    sketch = Sketch()
    for node, x_m, y_m in (
        (1, -7, -7),
        (2, 7, -7),
        (3, 7, 7),
        (4, -7, 7),
        (5, -150, -7),
        (6, 150, -7),
        (7, 150, 7),
        (8, -150, 7),
        (9, 7, -150),
        (10, 7, 150),
        (11, -7, 150),
        (12, -7, -150),
    ):
        sketch.node(node, x_m, y_m)
    sketch.road(100, [5, 1, 2, 6], "Ost", oneway="yes")
    sketch.road(101, [7, 3, 4, 8], "Ost", oneway="yes")
    sketch.road(102, [9, 2, 3, 10], "Nord", oneway="yes")
    sketch.road(103, [11, 4, 1, 12], "Nord", oneway="yes")
    found = only(sketch.junctions(tmp_path))
    assert found.summary.kind == "crossing"
    assert found.summary.arms == 4
    assert found.nodes == {1, 2, 3, 4}
    assert len(found.inner) == 4
    assert all(len(arm.outward) == 2 for arm in found.arms)
    assert abs(found.centre_xy_m).max() < 0.1
    assert found.summary.name == "Nord \u00d7 Ost"


@pytest.mark.parametrize("gap_m", [10.0, 35.0, 55.0])
def test_a_street_across_a_dual_carriageway_is_one_junction(gap_m: float, tmp_path: Path) -> None:
    sketch = Sketch()
    dual_carriageway(sketch, gap_m)
    sketch.node(30, 0.0, 150.0)
    sketch.node(31, 0.0, -150.0)
    sketch.road(130, [30, 22, 12, 31], "Gasse")
    found = only(sketch.junctions(tmp_path))
    assert (found.summary.kind, found.summary.arms) == ("crossing", 4)
    assert found.nodes == {12, 22}


def test_a_turning_place_in_the_median_is_none(tmp_path: Path) -> None:
    sketch = Sketch()
    dual_carriageway(sketch)
    sketch.road(130, [12, 22])
    assert sketch.junctions(tmp_path) == ()


def test_a_street_that_parts_into_its_carriageways_is_none(tmp_path: Path) -> None:
    sketch = Sketch()
    for node, x_m, y_m in (
        (1, -200, 0),
        (2, -60, 0),
        (3, -45, -8),
        (4, 45, -8),
        (5, 60, 0),
        (6, 200, 0),
        (7, 45, 8),
        (8, -45, 8),
    ):
        sketch.node(node, x_m, y_m)
    sketch.road(100, [1, 2], "Mohrenstraße")
    sketch.road(101, [2, 3, 4, 5], "Mohrenstraße", oneway="yes")
    sketch.road(102, [5, 7, 8, 2], "Mohrenstraße", oneway="yes")
    sketch.road(103, [5, 6], "Mohrenstraße")
    assert sketch.junctions(tmp_path) == ()


def test_a_side_street_with_a_traffic_island_is_one_junction(tmp_path: Path) -> None:
    sketch = Sketch()
    for node, x_m, y_m in (
        (1, -150, 0),
        (2, -10, 0),
        (3, 10, 0),
        (4, 150, 0),
        (5, 0, 25),
        (6, 0, 150),
    ):
        sketch.node(node, x_m, y_m)
    sketch.road(100, [1, 2, 3, 4], "Haupt", highway="primary")
    sketch.road(101, [6, 5], "Neben")
    sketch.road(102, [5, 2], "Neben", oneway="yes")
    sketch.road(103, [3, 5], "Neben", oneway="yes")
    found = only(sketch.junctions(tmp_path))
    assert (found.summary.kind, found.summary.arms) == ("t_junction", 3)
    assert found.nodes == {2, 3, 5}


@pytest.mark.parametrize(
    ("offset_m", "kinds"), [(14, ["staggered"]), (27, ["staggered"]), (60, ["t_junction"] * 2)]
)
def test_offset_side_streets(offset_m: float, kinds: list[str], tmp_path: Path) -> None:
    sketch = Sketch()
    for node, x_m, y_m in (
        (1, -200, 0),
        (2, 0, 0),
        (3, offset_m, 0),
        (4, 200, 0),
        (5, 0, 150),
        (6, offset_m, -150),
    ):
        sketch.node(node, x_m, y_m)
    sketch.road(100, [1, 2, 3, 4], "Haupt")
    sketch.road(101, [5, 2], "Links")
    sketch.road(102, [6, 3], "Rechts")
    assert [j.summary.kind for j in sketch.junctions(tmp_path)] == kinds


def test_a_slip_road_belongs_to_the_corner_that_it_cuts(tmp_path: Path) -> None:
    sketch = star([0, 90, 180, 270], 200.0)
    sketch.node(40, -50.0, 0.0)
    sketch.node(41, -25.0, -12.0)
    sketch.node(42, -10.0, -28.0)
    sketch.node(43, 0.0, -50.0)
    sketch.ways.clear()
    sketch.road(100, [4, 40, 1, 2], "Ost", highway="primary")
    sketch.road(101, [3, 1, 43, 5], "Nord", highway="primary")
    sketch.way(102, [40, 41, 42, 43], highway="primary_link", oneway="yes")
    found = only(sketch.junctions(tmp_path))
    assert (found.summary.kind, found.summary.arms) == ("crossing", 4)
    assert found.nodes == {1, 40, 43}
    assert off_centre_m(sketch, found) < 0.1
    assert found.summary.id == "n1"


def test_a_ramp_that_joins_a_motorway_is_a_merge(tmp_path: Path) -> None:
    sketch = Sketch()
    for node, x_m, y_m in ((1, -300, 0), (2, 0, 0), (3, 300, 0), (4, -200, -60), (5, -60, -8)):
        sketch.node(node, x_m, y_m)
    sketch.way(100, [1, 2, 3], highway="motorway", ref="A 7")
    sketch.way(101, [4, 5, 2], highway="motorway_link", oneway="yes")
    found = only(sketch.junctions(tmp_path))
    assert (found.summary.kind, found.summary.arms) == ("merge", 3)


def test_left_hand_traffic_is_said(tmp_path: Path) -> None:
    sketch = Sketch(MANCHESTER)
    for node, x_m, y_m in ((1, 0, 0), (2, 100, 0), (3, -100, 0), (4, 0, 100)):
        sketch.node(node, x_m, y_m)
        if node > 1:
            sketch.road(100 + node, [1, node])
    assert only(sketch.junctions(tmp_path)).summary.driving_side == "left"


def test_an_edit_elsewhere_changes_no_id(tmp_path: Path) -> None:
    sketch = star([0, 90, 180, 270])
    before = only(sketch.junctions(tmp_path)).summary.id
    for node, x_m, y_m in ((900, 500, 500), (901, 600, 500), (902, 500, 600), (903, 400, 500)):
        sketch.node(node, x_m, y_m)
        if node > 900:
            sketch.road(node, [900, node])
    after = [junction.summary.id for junction in sketch.junctions(tmp_path)]
    assert before in after
    assert len(after) == 2


def test_side_streets_on_the_same_side_stay_two_junctions(tmp_path: Path) -> None:
    sketch = Sketch()
    for node, x_m, y_m in (
        (1, -200, 0),
        (2, 0, 0),
        (3, 27, 0),
        (4, 200, 0),
        (5, 0, 150),
        (6, 27, 150),
    ):
        sketch.node(node, x_m, y_m)
    sketch.road(100, [1, 2, 3, 4], "Haupt")
    sketch.road(101, [5, 2], "Erste")
    sketch.road(102, [6, 3], "Zweite")
    assert [j.summary.kind for j in sketch.junctions(tmp_path)] == ["t_junction"] * 2


def test_the_start_of_a_slip_road_stays_with_its_corner(tmp_path: Path) -> None:
    """Another side street 15 m before a slip road parts makes a junction of its own."""
    sketch = Sketch()
    for node, x_m, y_m in (
        (1, -150, 0),
        (2, -55, 0),
        (3, -40, 0),
        (4, 0, 0),
        (5, 150, 0),
        (6, -55, 120),
        (7, 0, -35),
        (8, 0, -150),
        (9, -12, -8),
    ):
        sketch.node(node, x_m, y_m)
    sketch.node(50, -18.0, 0.0, highway="traffic_signals", traffic_signals__direction="forward")
    sketch.road(100, [1, 2, 3, 50, 4, 5], "Haupt", highway="secondary")
    sketch.road(101, [6, 2], "Neben")
    sketch.road(102, [4, 7, 8], "Quer", highway="secondary", oneway="yes")
    sketch.road(103, [3, 9, 7], highway="secondary_link", oneway="yes")
    found = {j.summary.name: j for j in sketch.junctions(tmp_path)}
    assert found["Haupt \u00d7 Neben"].nodes == {2}
    assert found["Haupt \u00d7 Quer"].nodes == {3, 4, 7}
    assert {j.summary.kind for j in found.values()} == {"t_junction"}
    assert found["Haupt \u00d7 Quer"].lights == {50}
