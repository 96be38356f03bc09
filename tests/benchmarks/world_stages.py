"""One World from a warm index to a compiled model with 1,000 building parts, stage by stage."""

from __future__ import annotations

import os
import time
from collections.abc import Callable
from pathlib import Path
from typing import TypeVar

import numpy as np
import shapely

from foretwin.orchestrator.worlds.opening import open_map
from foretwin.world_gen.build import build_world
from foretwin.world_gen.buildings.convex_parts import convex_cover
from foretwin.world_gen.buildings.footprints import buildings_in_frame
from foretwin.world_gen.export.mjcf import world_spec
from foretwin.world_gen.junctions.intersections import Junction
from foretwin.world_gen.junctions.map_index import MapIndex, index_map
from tests.benchmarks.measuring import Measurement, UnavailableError

BUDGET_S = 0.25
PARTS = 1_000
SAMPLE, REPEATS = 8, 4
_RADII_M = (100.0, 125.0, 150.0, 175.0, 200.0, 250.0, 300.0, 350.0, 400.0)
_Made = TypeVar("_Made")


class _Stages:
    """Seconds that each stage took, of every World."""

    def __init__(self) -> None:
        self.taken_s: dict[str, list[float]] = {}

    def time(self, stage: str, work: Callable[[], _Made]) -> _Made:
        start = time.perf_counter()
        made = work()
        self.taken_s.setdefault(stage, []).append(time.perf_counter() - start)
        return made


def measure() -> Measurement:
    """Return the 95th percentile in wall seconds over a sample of junctions, against 0.25 s.

    Each junction's World is as wide as holds 1,000 building parts; the map is that of
    Bad Hersfeld. `lanes` is all of the World but its buildings; the median of each stage is
    given, and reading the map and indexing it, which happen once.
    """
    data = os.environ.get("FORETWIN_DATA")
    if not data:
        raise UnavailableError("FORETWIN_DATA is not set: no map with enough buildings")
    stages = _Stages()
    path = Path(data) / "osm-badhersfeld" / "badhersfeld.osm.xml.gz"
    # As commands open maps: the collector is told to leave alone what stays.
    opened = stages.time("read", lambda: open_map(path))
    osm, graph, junctions = opened.osm, opened.graph, opened.junctions
    index = stages.time("index", lambda: index_map(osm, graph, junctions))
    wide = [
        (junction, radius)
        for junction in junctions[:: max(1, len(junctions) // 40)]
        if (radius := _radius_with_parts(index, junction)) is not None
    ][:SAMPLE]
    if not wide:
        raise UnavailableError(f"no junction of {path} has {PARTS} building parts around it")
    parts = [
        _make(stages, index, junction, radius) for _ in range(REPEATS) for junction, radius in wide
    ]
    more = {f"{stage}_s": float(np.median(taken)) for stage, taken in stages.taken_s.items()}
    more["whole_cpu_p95_s"] = float(np.percentile(stages.taken_s["whole_cpu"], 95))
    more["worlds"], more["parts"] = len(parts), float(np.median(parts))
    p95 = float(np.percentile(stages.taken_s["whole"], 95))
    return Measurement(p95, "s (p95)", BUDGET_S, more)


def _radius_with_parts(index: MapIndex, junction: Junction) -> float | None:
    """Return the least radius whose World has `PARTS` building parts; None where none has."""
    for radius in _RADII_M:
        near = index.buildings.within(_disc(junction, radius))
        if len(near) * 2 < PARTS * 0.8:
            continue
        made = build_world(index.osm, index.graph, junction, radius_m=radius, index=index)
        if len(convex_cover([(b.outline, b.holes) for b in made.buildings]).rings) >= PARTS:
            return radius
    return None


def _make(stages: _Stages, index: MapIndex, junction: Junction, radius_m: float) -> int:
    osm, graph = index.osm, index.graph
    start, cpu_start = time.perf_counter(), time.process_time()
    world = stages.time(
        "build", lambda: build_world(osm, graph, junction, radius_m=radius_m, index=index)
    )
    spec = stages.time("spec", lambda: world_spec(world))
    stages.time("compile", spec.compile)
    stages.taken_s.setdefault("whole", []).append(time.perf_counter() - start)
    stages.taken_s.setdefault("whole_cpu", []).append(time.process_time() - cpu_start)
    # Again, alone: what of the above went into buildings.
    near = index.buildings.within(_disc(junction, radius_m))
    nowhere = np.zeros(0, dtype=object)
    stages.time("footprints", lambda: buildings_in_frame(near, world.frame, graph.frame, nowhere))
    rings = [(b.outline, b.holes) for b in world.buildings]
    stages.time("convex_parts", lambda: convex_cover(rings))
    stages.taken_s.setdefault("lanes", []).append(
        stages.taken_s["build"][-1] - stages.taken_s["footprints"][-1]
    )
    return sum(geom.name.startswith("building:") for geom in spec.geoms)


def _disc(junction: Junction, radius_m: float) -> shapely.Geometry:
    return shapely.Point(*junction.centre_xy_m).buffer(radius_m)
