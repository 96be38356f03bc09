"""A map mirrored east for west, or whose ways run the other way, are parted elsewhere or have other
ids, gives the same World, mirrored or not: no drawing and no truth of ours is needed to see where a
rule knows one side alone, or what a mapper did and no driver sees."""

from __future__ import annotations

import functools
import math
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial import cKDTree

from foretwin.contracts.arrays import Array
from foretwin.contracts.frames import LocalFrame, geo_from_local, local_from_geo
from foretwin.contracts.world import World
from foretwin.geometry.polyline import arc_lengths, points_at
from foretwin.world_gen.build import build_world
from foretwin.world_gen.junctions.find_intersections import find_intersections
from foretwin.world_gen.junctions.intersections import Junction
from foretwin.world_gen.junctions.map_index import index_map
from foretwin.world_gen.osm.osm_map import OsmMap
from foretwin.world_gen.osm.read_osm import read_map
from foretwin.world_gen.roads.build_graph import build_road_graph
from tests.data.junctions.draw import draw_all
from tests.world_gen.data_maps import MAPS
from tests.world_gen.mirror import OTHER
from tests.world_gen.sketch import Sketch
from tests.world_gen.transformed_maps import (
    mirrored_map,
    renumbered_map,
    reversed_map,
    split_map,
)

COVERS = (
    "foretwin.world_gen.ground.crossings",
    "foretwin.world_gen.lanes.trims",
)
APART_M = 0.1
"""Places in a map are whole 1e-7 degrees, and its mirror image is rounded anew."""
BY_SIDE = ("near_side", "lesser_road")
"""Rules that are another matter on the other side: `tests.world_gen.mirror.STEM_WAITS`."""
BY_ID = ("order",)
"""The rule where all others leave open who waits."""


def _worlds(osm: OsmMap, every: int) -> list[World]:
    graph = build_road_graph(osm)
    junctions = find_intersections(osm, graph)
    index = index_map(osm, graph, junctions)

    def place(junction: Junction) -> tuple[float, float]:
        away_deg = abs(junction.summary.lon - osm.frame.origin.lon_deg)
        return round(junction.summary.lat, 7), round(away_deg, 7)

    return [
        build_world(osm, graph, junction, radius_m=80.0, index=index, ground=False)
        for junction in sorted(junctions, key=place)[::every]
    ]


def _rows(
    world: World, frame: LocalFrame, about_deg: float | None, left_out: tuple[str, ...]
) -> dict[str, Array]:
    """Return by subject one row for each thing of a World: where it lies, in a frame given.

    What is mirrored about a longitude is mirrored back; conflicts by some rules are left out.
    """

    def placed(xy_m: Array) -> Array:
        lat, lon = geo_from_local(world.frame, xy_m).T
        if about_deg is not None:
            lon = 2.0 * about_deg - lon
        return local_from_geo(frame, lat, lon)

    def line(xy_m: Array) -> Array:
        return placed(points_at(xy_m, np.linspace(0.0, arc_lengths(xy_m)[-1], 7))).ravel()

    paths = {c.id: line(c.centerline) for c in world.connections}
    step = 1 if about_deg is None else -1
    crossed = [placed(crossing.line) for crossing in world.crossings]
    return {
        "lanes": np.array([line(lane.centerline) for lane in world.lanes]),
        "connections": np.array(list(paths.values())),
        "stop lines": np.array([placed(s.ends[::step]).ravel() for s in world.stop_lines]),
        "crossings": np.array([[*c.mean(axis=0), *np.abs(c[1] - c[0])] for c in crossed]),
        "who waits": np.array(
            [
                np.concatenate([paths[c.yields_id], paths[c.goes_id]])
                for c in world.conflicts
                if c.rule not in left_out
                and not (c.rule == "turn_across" and c.source == "default")
            ]
        ),
    }


def _differences(
    osm: OsmMap,
    worlds: list[World],
    other: OsmMap,
    *,
    mirrored: bool,
    every: int = 1,
    within_m: float = math.inf,
) -> list[str]:
    """Return what lies elsewhere in the Worlds of another map, and where, near their middles."""
    found = []
    about_deg = osm.frame.origin.lon_deg if mirrored else None
    left_out = BY_SIDE if mirrored else BY_ID
    pairs = zip(worlds, _worlds(other, every), strict=True)
    for before, after in pairs:
        mine = _rows(before, before.frame, None, left_out)
        its = _rows(after, before.frame, about_deg, left_out)
        for subject in mine:
            rows, others = (
                part[subject][np.abs(part[subject]).max(axis=1, initial=0.0) < within_m]
                if len(part[subject])
                else part[subject]
                for part in (mine, its)
            )
            if len(rows) != len(others):
                found.append(f"{before.intersection.id}: {len(others)} {subject}")
            elif len(rows):
                for a, b in ((rows, others), (others, rows)):
                    apart_m, _ = cKDTree(a).query(b, p=np.inf)
                    if apart_m.max() > APART_M:
                        found.append(f"{before.intersection.id}: {subject} {apart_m.max():.2f} m")
    return sorted(set(found))


def _checked(osm: OsmMap, every: int = 1) -> None:
    side = OTHER[build_road_graph(osm).driving_side]
    differences = functools.partial(_differences, osm, _worlds(osm, every), every=every)
    assert not differences(mirrored_map(osm, side), mirrored=True)
    assert not differences(reversed_map(osm), mirrored=False)
    assert not differences(renumbered_map(osm, 2), mirrored=False)


@pytest.fixture(scope="module")
def drawn(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("drawn")
    draw_all(folder)
    return folder


def test_drawn_junctions_are_built_alike_from_either_side(drawn: Path) -> None:
    for path in sorted(drawn.glob("*.osm")):
        osm = read_map(path)
        worlds = _worlds(osm, 1)
        for other, mirrored in (
            (mirrored_map(osm, OTHER[build_road_graph(osm).driving_side]), True),
            (reversed_map(osm), False),
            (renumbered_map(osm, 1), False),
        ):
            assert not _differences(osm, worlds, other, mirrored=mirrored), (path.name, mirrored)


def test_lanes_run_on_where_a_cycle_lane_begins_on_either_side(tmp_path: Path) -> None:
    sketch = Sketch()
    for node, (x_m, y_m) in enumerate([(0, 0), (60, 0), (120, 0), (0, 80), (0, -80)], start=1):
        sketch.node(node, x_m, y_m)
    sketch.road(10, [1, 2], "Ost", highway="secondary", lanes="2")
    sketch.road(11, [2, 3], "Ost", highway="secondary", lanes="2", cycleway__left="lane")
    sketch.road(12, [4, 1, 5], "Quer")
    _checked(sketch.read(tmp_path))


def test_a_crossing_at_a_bend_lies_across_both_pieces_of_the_road(tmp_path: Path) -> None:
    sketch = Sketch()
    for node, (x_m, y_m) in {1: (0, 0), 3: (60, 30), 4: (0, 80), 5: (0, -80)}.items():
        sketch.node(node, x_m, y_m)
    sketch.node(2, 30.0, 0.0, highway="crossing")
    sketch.road(10, [1, 2, 3], "Ost")
    sketch.road(12, [4, 1, 5], "Quer")
    _checked(sketch.read(tmp_path))
    (world,) = _worlds(sketch.read(tmp_path), 1)
    (across,) = world.crossings
    along = across.line[0] - across.line[1]
    assert np.degrees(np.arctan2(along[1], along[0])) == pytest.approx(112.5, abs=0.1)


@pytest.mark.real_data
@pytest.mark.parametrize("name", ["kingsway", "leeds", "austin", "berlin-mitte"])
def test_real_junctions_are_built_alike_from_either_side(name: str, data_dir: Path) -> None:
    _checked(read_map(data_dir / MAPS[name]), every=4)


@functools.lru_cache(1)
def _every_second(file: Path) -> tuple[OsmMap, list[World]]:
    osm = read_map(file)
    return osm, _worlds(osm, 2)


@pytest.mark.real_data
@pytest.mark.parametrize("share", [0.0, 0.5, 1.0])
@pytest.mark.parametrize("name", ["kingsway", "leeds", "berlin-mitte"])
def test_where_ways_are_parted_moves_nothing(name: str, share: float, data_dir: Path) -> None:
    osm, worlds = _every_second(data_dir / MAPS[name])
    parted = split_map(osm, share)
    assert len(parted.ways) > 1.15 * len(osm.ways)
    # The World ends elsewhere, and a road has as many more lanes as it has ways more.
    found = _differences(osm, worlds, parted, mirrored=False, every=2, within_m=50.0)
    assert [line for line in found if "lanes" not in line] == []
