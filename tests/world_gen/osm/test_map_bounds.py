"""A map's box: what its header declares, unless its roads say that this cannot be."""

from __future__ import annotations

from pathlib import Path

import pytest

from foretwin.world_gen.build import build_region
from foretwin.world_gen.osm.map_bounds import believed_bounds
from foretwin.world_gen.osm.map_store import MapStore
from foretwin.world_gen.osm.osm_map import LatLonBounds
from foretwin.world_gen.osm.read_osm import read_map
from foretwin.world_gen.roads.build_graph import build_road_graph
from tests.world_gen.sketch import Sketch

LEEDS = LatLonBounds(53.7954, -1.5398, 53.8063, -1.5286)
FIJI = LatLonBounds(-18.3, 178.3, -16.1, -179.7)
"""Across the antimeridian."""


@pytest.mark.parametrize(
    ("declared", "roads"),
    [
        (LatLonBounds(53.80, -1.535, 53.802, -1.533), LEEDS),
        (LatLonBounds(53.75, -1.60, 53.85, -1.50), LEEDS),
        (LatLonBounds(-19.5, 177.0, -15.5, -178.0), FIJI),
        (LatLonBounds(-18.0, 179.5, -16.5, 180.0), FIJI),
    ],
)
def test_a_box_that_fits_the_roads_is_believed(declared: LatLonBounds, roads: LatLonBounds) -> None:
    assert believed_bounds(declared, roads) == (declared, [])


@pytest.mark.parametrize(
    ("declared", "roads", "words"),
    [
        (LatLonBounds(0.0, 0.0, 90.0, 180.0), LEEDS, "holds none"),
        (LatLonBounds(0.0, -180.0, 90.0, 180.0), LEEDS, "far larger"),
        (LatLonBounds(54.0, -1.54, 54.1, -1.53), LEEDS, "holds none"),
        (LatLonBounds(53.79, 1.0, 53.81, 1.1), LEEDS, "holds none"),
        (LatLonBounds(-18.3, 176.0, -16.1, 177.0), FIJI, "holds none"),
        (LatLonBounds(-90.0, -180.0, 90.0, 180.0), FIJI, "far larger"),
    ],
)
def test_a_box_that_cannot_be_is_not_and_a_note_says_so(
    declared: LatLonBounds, roads: LatLonBounds, words: str
) -> None:
    bounds, notes = believed_bounds(declared, roads)
    assert bounds == roads
    assert [words in note for note in notes] == [True]


def test_without_a_box_it_is_that_of_the_roads() -> None:
    assert believed_bounds(None, LEEDS) == (LEEDS, [])


def test_a_map_whose_header_declares_a_quarter_of_the_earth_has_its_region(tmp_path: Path) -> None:
    sketch = Sketch(bounds='<bounds minlat="0" minlon="0" maxlat="90" maxlon="180"/>')
    sketch.node(1, 0.0, 0.0)
    sketch.node(2, 100.0, 100.0)
    sketch.road(10, [1, 2])
    osm = sketch.read(tmp_path)
    assert osm.bounds.north - osm.bounds.south < 0.001
    assert any("in the map's header" in note for note in osm.notes)
    world = build_region(osm, build_road_graph(osm), osm.bounds)
    assert [lane.osm_way for lane in world.lanes] == [10, 10]
    path = tmp_path / "declared.osm"
    path.write_text(sketch.xml())
    store = MapStore.open(path, tmp_path / "index")
    assert store.bounds == read_map(path).bounds
    assert store.meta.notes
    store.close()
