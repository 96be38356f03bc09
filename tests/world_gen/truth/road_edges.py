"""`python -m tests.world_gen.truth.road_edges`: how far real roads reach beyond the drawn edges.

HD maps say where cars can drive: kerb to kerb, with parking strips and the corners of junctions.
They are reduced to what OpenStreetMap would hold, and at each metre of the World's kerbs it is
measured across the kerb how far that ground goes on. `sim_worker/metrics/road_edges.py` has the
result.
"""

from __future__ import annotations

import json
import re
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import numpy as np
import shapely

from foretwin.contracts.arrays import Array
from foretwin.contracts.frames import target_from_source_m
from foretwin.contracts.world import World
from foretwin.geometry.polyline import arc_lengths, points_at
from foretwin.sim_worker.metrics.ground import polygon_of
from foretwin.world_gen.build import build_region
from foretwin.world_gen.junctions.find_intersections import find_intersections
from foretwin.world_gen.junctions.map_index import index_map
from foretwin.world_gen.osm.read_osm import read_map
from foretwin.world_gen.roads.build_graph import build_road_graph
from tests.world_gen.data_maps import data_folder
from tests.world_gen.truth.argoverse import argoverse_maps, drivable_area
from tests.world_gen.truth.hd_map import HdMap
from tests.world_gen.truth.reduced_map import reduced

_STEP_M, _ACROSS_M = 1.0, 0.3
_LOOK_M = 12.0
"""Ground that goes on for so long is another road's."""
_LANE_TAGS = re.compile(r'<tag k="(lanes|turn:lanes)[^"]*" v="[^"]*"/>')


class Beyond(NamedTuple):
    """Metres (N,) by which ground goes on beyond drawn kerbs, negative where it ends before."""

    counted_m: Array
    """Where the map counts lanes."""
    uncounted_m: Array


def measure(data: Path, work: Path) -> Beyond:
    """Measure on the HD maps in a data folder; maps are written into the folder `work`."""
    found: dict[bool, list[float]] = {True: [], False: []}
    for hd, area in zip(argoverse_maps(data), drivable_area(data), strict=True):
        text = reduced(hd)
        for counted in found:
            file = work / f"{hd.name.replace(' ', '-')}-{counted}.osm"
            file.write_text(text if counted else _LANE_TAGS.sub("", text), encoding="utf-8")
            found[counted] += _beyond(hd, area, world_of(file))
    return Beyond(np.array(found[True]), np.array(found[False]))


def world_of(file: Path) -> World:
    """Return the World of a whole map."""
    osm = read_map(file)
    graph = build_road_graph(osm)
    index = index_map(osm, graph, find_intersections(osm, graph))
    return build_region(osm, graph, osm.bounds, index=index)


def _beyond(hd: HdMap, area: shapely.Geometry, world: World) -> Iterator[float]:
    junctions = (j.area for j in world.junctions if j.area is not None)
    surface = shapely.union_all([polygon_of(one) for one in (*world.road_surface, *junctions)])
    for kerb in world.kerbs:
        at_m = np.arange(0.5, arc_lengths(kerb)[-1] - 0.5, _STEP_M)
        points, along = points_at(kerb, at_m), points_at(kerb, at_m + 0.3)
        along = (along - points) / np.maximum(np.hypot(*(along - points).T), 1e-9)[:, None]
        left = np.column_stack([-along[:, 1], along[:, 0]])
        inside = [
            shapely.contains_xy(surface, *(points + side * _ACROSS_M * left).T)
            for side in (1.0, -1.0)
        ]
        for k in np.flatnonzero(inside[0] != inside[1]):
            outward = -left[k] if inside[0][k] else left[k]
            ends = np.stack([points[k], points[k] + _LOOK_M * outward])
            ray = shapely.LineString(target_from_source_m(hd.frame, world.frame, ends))
            here = shapely.Point(ray.coords[0])
            away = shapely.distance(here, shapely.intersection(ray, shapely.boundary(area)))
            if not shapely.contains(area, here):
                yield -float(shapely.distance(here, area))
            elif np.isfinite(away):
                yield float(away)


def main() -> None:
    """Print the quantiles."""
    data = data_folder()
    with tempfile.TemporaryDirectory(prefix="foretwin-edges-") as folder:
        found = measure(data / "map-av2-pittsburgh", Path(folder))
    told = (5, 50, 75, 90, 95, 99)
    for name, beyond_m in found._asdict().items():
        text = ", ".join(f"p{q} {np.percentile(beyond_m, q):.2f}" for q in told)
        print(f"{name}: {len(beyond_m)} places, m beyond the drawn edge: {text}")
    print(
        json.dumps(
            {name: round(float(np.percentile(v, 95)), 2) for name, v in found._asdict().items()}
        )
    )


if __name__ == "__main__":
    main()
