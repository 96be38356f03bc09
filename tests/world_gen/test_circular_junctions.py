"""A ring with its arms is one junction; only the tag makes it a roundabout."""

from __future__ import annotations

import math
from pathlib import Path

from tests.world_gen.sketch import Sketch, off_centre_m, only, star

COVERS = ("foretwin.world_gen.junctions.chains",)


def roundabout(kind: str = "roundabout") -> Sketch:
    """A ring of two ways and 15 m radius; the eastern arm parts 25 m before it."""
    sketch = Sketch()
    for step in range(8):
        angle = math.radians(45.0 * step)
        sketch.node(1 + step, 15.0 * math.cos(angle), 15.0 * math.sin(angle))
    sketch.road(100, [1, 2, 3, 4, 5], junction=kind)
    sketch.road(101, [5, 6, 7, 8, 1], junction=kind)
    for node, x_m, y_m in ((20, 40, 0), (21, 150, 0), (22, 0, 150), (23, -150, 0)):
        sketch.node(node, x_m, y_m)
    sketch.road(110, [20, 2], "Ost", oneway="yes")
    sketch.road(111, [8, 20], "Ost", oneway="yes")
    sketch.road(112, [20, 21], "Ost")
    sketch.road(113, [22, 3], "Nord")
    sketch.road(114, [23, 5], "West")
    return sketch


def test_a_roundabout_is_one_junction_with_the_parting_of_its_arms(tmp_path: Path) -> None:
    sketch = roundabout()
    found = only(sketch.junctions(tmp_path))
    assert (found.summary.kind, found.summary.arms) == ("roundabout", 3)
    assert found.summary.control == "roundabout"
    assert found.nodes == {2, 3, 5, 8, 20}
    assert found.summary.id == "n2", "where its ways are parted says nothing"
    assert off_centre_m(sketch, found) < 0.1
    assert [arm.name for arm in found.arms] == ["Ost", "Nord", "West"]


def test_a_circular_place_has_no_roundabout_rules(tmp_path: Path) -> None:
    summary = only(roundabout("circular").junctions(tmp_path)).summary
    assert (summary.kind, summary.control) == ("circular", "uncontrolled")


def test_a_ring_without_the_tag_is_no_roundabout(tmp_path: Path) -> None:
    kinds = {junction.summary.kind for junction in roundabout("").junctions(tmp_path)}
    assert not kinds & {"roundabout", "circular"}


def test_a_painted_roundabout(tmp_path: Path) -> None:
    sketch = star([0, 120, 240])
    sketch.nodes[0] = sketch.nodes[0].replace(
        "</node>", '<tag k="highway" v="mini_roundabout"/></node>'
    )
    summary = only(sketch.junctions(tmp_path)).summary
    assert (summary.kind, summary.control) == ("mini_roundabout", "roundabout")


def test_the_order_in_the_file_does_not_matter(tmp_path: Path) -> None:
    there, back = roundabout(), roundabout()
    back.nodes.reverse()
    back.ways.reverse()
    a, b = only(there.junctions(tmp_path)), only(back.junctions(tmp_path))
    assert a.summary == b.summary
    assert a.inner == b.inner
