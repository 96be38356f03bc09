"""What is paved where roads meet."""

from __future__ import annotations

import math
from pathlib import Path

from shapely.geometry import Point, Polygon, box

from foretwin.contracts.world import World
from tests.world_gen.chain import build_all
from tests.world_gen.sketch import MANCHESTER, Sketch


def folded(folder: Path) -> World:
    """Return a street that goes 34 m south and turns to the east, and a wider one, of wider lanes,
    that lies on it as far as the bend."""
    sketch = Sketch(MANCHESTER)
    for node, place_m in {1: (0.0, 0.0), 2: (0.0, -34.0), 3: (0.0, 0.0), 4: (85.0, 0.0)}.items():
        sketch.node(node, *place_m)
    sketch.way(101, [3, 2, 4], highway="residential", width="5.4")
    sketch.way(102, [3, 2, 1], highway="residential", cycleway="lane")
    path = folder / "drawn.osm"
    path.write_text(sketch.xml(), encoding="utf-8")
    (world,) = build_all(path, radius_m=60.0).worlds
    return world


def test_where_roads_lie_on_one_another_the_outside_of_their_bend_is_round(tmp_path: Path) -> None:
    # Their union holds points that rounding has parted, by whose distance GEOS would divide.
    (area,) = [a for a in folded(tmp_path).road_surface if a.id == "road:0:2"]
    outside = Polygon(area.outline, area.holes).intersection(box(-9.0, -9.0, 0.0, 0.0))
    wider_half_m = 3.0 + 1.6
    assert outside.area > 0.95 * math.pi / 4.0 * wider_half_m**2
    assert Point(0.0, 0.0).buffer(wider_half_m + 0.01).contains(outside)
