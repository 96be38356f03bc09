"""A tidal street through a crossing, drawn to the west, with routes along it."""

from __future__ import annotations

import json
from pathlib import Path

from foretwin.contracts.frames import geo_from_local
from foretwin.contracts.world import World
from tests.world_gen.sketch import Sketch

_WAY = 10


class TidalStreet:
    """Its map, and a route to the east, in a folder."""

    def __init__(self, folder: Path) -> None:
        sketch = Sketch()
        places = ((1, -200.0, 0.0), (2, 0.0, 0.0), (3, 200.0, 0.0), (4, 0.0, 90.0), (5, 0.0, -90.0))
        for node, x_m, y_m in places:
            sketch.node(node, x_m, y_m)
        sketch.road(_WAY, [3, 2, 1], "Street", oneway="reversible", lanes="2")
        sketch.road(11, [4, 2, 5], "Lane")
        self.map_file, self.eastward = folder / "tidal.osm", folder / "east.geojson"
        self.map_file.write_text(sketch.xml(), encoding="utf-8")
        line = geo_from_local(sketch.frame, [[-180.0, 0.0], [180.0, 0.0]]).tolist()  # type: ignore[arg-type]
        geometry = {"type": "LineString", "coordinates": [[lon, lat] for lat, lon in line]}
        self.eastward.write_text(json.dumps(geometry), encoding="utf-8")

    def headings(self, world: World) -> set[str]:
        """Whither the lanes of the street lead."""
        lines = [lane.centerline for lane in world.lanes if lane.osm_way == _WAY]
        return {"east" if line[-1, 0] > line[0, 0] else "west" for line in lines}
