"""Buildings of the real extracts: from the map's outline to the parts that are run into."""

from __future__ import annotations

from pathlib import Path

import msgspec
import numpy as np
import numpy.typing as npt
import pytest
import shapely

from foretwin.world_gen.buildings.convex_parts import convex_cover
from foretwin.world_gen.buildings.footprints import (
    SILHOUETTE_TOLERANCE_M,
    BuildingIndex,
    buildings_in_frame,
)
from foretwin.world_gen.export.mjcf import world_spec
from foretwin.world_gen.osm.read_osm import read_map
from tests.world_gen.drawn_maps import crossing, world_of

pytestmark = pytest.mark.real_data

CHUNK = 1_500
EVERYWHERE = shapely.box(-1e6, -1e6, 1e6, 1e6)
SLOT_M = SILHOUETTE_TOLERANCE_M
"""Slots in a wall narrower than this are no silhouette, nor are cracks between convex parts."""


def _without_slots(shapes: npt.NDArray[np.object_]) -> npt.NDArray[np.object_]:
    wider = shapely.buffer(shapes, SLOT_M / 2)
    closed: npt.NDArray[np.object_] = shapely.buffer(wider, -SLOT_M / 2)
    return closed


BIG = {
    "osm-badhersfeld/badhersfeld.osm.xml.gz": 11_000,
    "osm-liechtenstein/liechtenstein-latest.osm.pbf": 8_900,
}
SMALL = {
    "osm-monaco/monaco.osm.gz": 900,
    "osm-berlin-mitte/berlin-mitte.osm": 400,
    "osm-berlin-moritzplatz/berlin-moritzplatz.osm": 300,
    "osm-kingsway/kingsway_junction.osm": 10,
}


@pytest.mark.parametrize(("file", "buildings"), SMALL.items())
def test_silhouettes_are_kept_and_every_part_compiles(
    data_dir: Path, file: str, buildings: int
) -> None:
    _check(data_dir / file, buildings, every=1)


@pytest.mark.parametrize(("file", "buildings"), BIG.items())
def test_silhouettes_are_kept_in_a_sample_of_large_maps(
    data_dir: Path, file: str, buildings: int
) -> None:
    _check(data_dir / file, buildings, every=5)


@pytest.mark.judge
@pytest.mark.parametrize(("file", "buildings"), BIG.items())
def test_silhouettes_are_kept_in_large_maps(data_dir: Path, file: str, buildings: int) -> None:
    _check(data_dir / file, buildings, every=1)


def _check(map_file: Path, buildings: int, *, every: int) -> None:
    osm = read_map(map_file)
    found = BuildingIndex(osm).within(EVERYWHERE)
    assert len(found) >= buildings
    found = found[::every]
    built = buildings_in_frame(found, osm.frame, osm.frame, np.zeros(0, dtype=object)).buildings
    parts = convex_cover([(b.outline, b.holes) for b in built])
    row = {f.id: k for k, f in enumerate(found)}
    of_building = np.array([row[_footprint_id(b.id, row)] for b in built])
    owner = of_building[parts.owner]
    order = np.argsort(owner, kind="stable")
    polygons = np.array([shapely.Polygon(parts.rings[k]) for k in order], dtype=object)
    together = shapely.multipolygons(polygons, indices=owner[order])
    assert len(np.unique(owner)) == len(found)
    kept = _without_slots(together)
    before = _without_slots(np.array([f.polygon for f in found], dtype=object))
    moved = shapely.hausdorff_distance(shapely.boundary(before), shapely.boundary(kept))
    worst = int(np.argmax(moved))
    assert moved[worst] <= SILHOUETTE_TOLERANCE_M, (found[worst].id, moved[worst])

    empty = world_of(crossing())
    for begin in range(0, len(built), CHUNK):
        world = msgspec.structs.replace(empty, buildings=built[begin : begin + CHUNK])
        assert world_spec(world).compile().ngeom > 1


def _footprint_id(building: str, known: dict[str, int]) -> str:
    return building if building in known else building.rpartition("-")[0]
