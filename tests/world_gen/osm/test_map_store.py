"""A map read once into an index gives the same Worlds as the map read whole, in little memory."""

from __future__ import annotations

import contextlib
import json
import math
import sqlite3
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from foretwin.contracts.frames import METRES_PER_DEG, GeoPoint, geo_from_local
from foretwin.contracts.owned_folder import LOCK, own
from foretwin.world_gen.build import build_world
from foretwin.world_gen.junctions.find_intersections import find_intersections
from foretwin.world_gen.junctions.map_index import index_map
from foretwin.world_gen.osm.map_store import MapStore, index_path
from foretwin.world_gen.osm.osm_map import LatLonBounds, MapError, OsmMap
from foretwin.world_gen.osm.read_osm import read_map
from foretwin.world_gen.roads.build_graph import build_road_graph
from tests.world_gen.large_map import write_large_map
from tests.world_gen.sketch import Sketch, star

COVERS = (
    "foretwin.world_gen.osm.build_map_store",
    "foretwin.world_gen.osm.clip",
    "foretwin.world_gen.osm.map_cells",
    "foretwin.world_gen.osm.map_tables",
    "foretwin.world_gen.osm.node_spool",
    "foretwin.world_gen.osm.opl_stream",
)

EVERYWHERE = LatLonBounds(-90.0, -180.0, 90.0, 180.0)


def town(folder: Path, *, shuffled: bool = False) -> Path:
    """Draw a crossing, a house with a courtyard, a house far away, a road without one node."""
    sketch = star([0.0, 90.0, 180.0, 270.0])
    sketch.node(9, 5.0, 5.0, highway="traffic_signals")
    for first, x_m, size_m in ((20, 40.0, 20.0), (30, 45.0, 5.0), (40, 9000.0, 20.0)):
        corners = ((0, 0), (1, 0), (1, 1), (0, 1))
        for i, (east, north) in enumerate(corners):
            sketch.node(first + i, x_m + east * size_m, 40.0 + north * size_m)
    for way, first in ((50, 20), (51, 30), (52, 40)):
        tags = {"building": "yes"} if way == 52 else {}
        sketch.way(way, [*range(first, first + 4), first], **tags)
    sketch.relation(60, {50: "outer", 51: "inner"}, type="multipolygon", building="yes")
    sketch.relation(61, {777: "outer"}, type="multipolygon", building="yes")
    sketch.road(53, [2, 888, 3, 4], "Gap")
    if shuffled:
        sketch.nodes.reverse()
        sketch.ways.reverse()
    path = folder / "town.osm"
    path.write_text(sketch.xml(), encoding="utf-8")
    return path


def assert_same(clip: OsmMap, whole: OsmMap) -> None:
    assert clip.ways == whole.ways
    assert list(clip.ways) == list(whole.ways)
    assert clip.locations == whole.locations
    assert clip.node_tags == whole.node_tags
    assert clip.relations == whole.relations
    assert clip.frame == whole.frame
    assert clip.sha256 == whole.sha256
    assert clip.attribution == whole.attribution


@pytest.mark.parametrize("shuffled", [False, True])
def test_all_of_it_is_the_map_read_whole(tmp_path: Path, shuffled: bool) -> None:
    path = town(tmp_path, shuffled=shuffled)
    store = MapStore.open(path, tmp_path / "index")
    whole = read_map(path)
    assert_same(store.clip(EVERYWHERE), whole)
    assert store.clip(EVERYWHERE).note_places == whole.note_places
    assert store.clip(EVERYWHERE).notes == tuple(n for n in whole.notes if n.startswith("way 53"))
    assert store.meta.notes == tuple(n for n in whole.notes if n.startswith("relation 61"))


def test_a_map_whose_ways_are_all_without_nodes_is_refused(tmp_path: Path) -> None:
    sketch = Sketch()
    sketch.node(1, 0.0, 0.0)
    sketch.road(10, [888, 889])
    path = tmp_path / "gone.osm"
    path.write_text(sketch.xml(), encoding="utf-8")
    with pytest.raises(MapError, match="holds no roads"):
        MapStore.open(path, tmp_path / "index")


def test_a_clip_holds_what_touches_it_and_no_more(tmp_path: Path) -> None:
    store = MapStore.open(town(tmp_path), tmp_path / "index")
    corners = geo_from_local(Sketch().frame, np.array([[41.0, -1.0], [42.0, 42.0]]))
    clip = store.clip(LatLonBounds(*corners[0].tolist(), *corners[1].tolist()))
    # It touches the outline alone; the courtyard comes along with the relation.
    assert list(clip.ways) == [50, 51, 102]
    assert clip.ways[102].nodes == (1, 2)
    assert list(clip.relations) == [60]
    assert not clip.node_tags


def test_a_route_clips_what_lies_along_it(tmp_path: Path) -> None:
    store = MapStore.open(town(tmp_path), tmp_path / "index")
    line = geo_from_local(Sketch().frame, np.array([[-100.0, 0.0], [100.0, 0.0], [9000.0, 0.0]]))
    assert 52 in store.clip_route(line, 100.0).ways
    assert 52 not in store.clip_route(line[:2], 100.0).ways
    with pytest.raises(MapError, match="holds no roads"):
        store.clip_route(line[2:], 100.0)


def test_beyond_the_antimeridian(tmp_path: Path) -> None:
    sketch = Sketch(GeoPoint(-16.8, 180.0))
    for node, x_m in ((1, -400.0), (2, -100.0), (3, 100.0), (4, 400.0)):
        sketch.node(node, x_m, 0.0)
    for way, nodes in ((10, [1, 2]), (11, [2, 3]), (12, [3, 4])):
        sketch.road(way, nodes)
    path = tmp_path / "fiji.osm"
    path.write_text(sketch.xml(), encoding="utf-8")
    store = MapStore.open(path, tmp_path / "index")
    assert_same(store.clip(LatLonBounds(-17.0, 179.9, -16.0, -179.9)), read_map(path))
    assert list(store.clip(LatLonBounds(-17.0, 179.9, -16.0, 179.998)).ways) == [10, 11]


def test_an_index_is_made_once_and_known_by_what_the_map_holds(tmp_path: Path) -> None:
    path, folder = town(tmp_path), tmp_path / "index"
    heard: list[tuple[int, int]] = []
    first = MapStore.open(path, folder, lambda done, total: heard.append((done, total)))
    assert heard[-1] == (path.stat().st_size, path.stat().st_size)
    assert first.path == index_path(folder, read_map(path).sha256)
    copy = path.with_name("copy.osm")
    copy.write_bytes(path.read_bytes())
    heard.clear()
    assert MapStore.open(copy, folder, lambda *_: heard.append(_)).path == first.path
    assert not heard
    path.write_bytes(path.read_bytes().replace(b"Gap", b"Lane"))
    assert MapStore.open(path, folder).path != first.path


def test_a_damaged_index_is_built_anew(tmp_path: Path) -> None:
    path, folder = town(tmp_path), tmp_path / "index"
    store = MapStore.open(path, folder)
    store.close()
    store.path.write_bytes(store.path.read_bytes()[:1000])
    assert_same(MapStore.open(path, folder).clip(EVERYWHERE), read_map(path))


def test_a_cell_that_is_damaged_is_named(tmp_path: Path) -> None:
    path, folder = town(tmp_path), tmp_path / "index"
    store = MapStore.open(path, folder)
    store.close()
    with contextlib.closing(sqlite3.connect(store.path, isolation_level=None)) as database:
        database.execute("UPDATE piece SET body = x'00112233'")
    with pytest.raises(MapError, match="map index is damaged; remove it"):
        MapStore.open(path, folder).clip(EVERYWHERE)


def test_what_a_killed_build_left_behind_goes_with_the_next_one(tmp_path: Path) -> None:
    folder = tmp_path / "index"
    left, at_work = folder / "building-left", folder / "building-at-work"
    for part in (left, at_work):
        part.mkdir(parents=True)
        (part / "nodes.bin").write_bytes(b"x")
        (part / LOCK).write_bytes(b"")
    owned = own(at_work)
    assert owned is not None
    MapStore.open(town(tmp_path), folder)
    assert not left.exists()
    assert at_work.exists()
    owned.remove()


def test_what_cannot_be_read_leaves_no_index(tmp_path: Path) -> None:
    path, folder = town(tmp_path), tmp_path / "index"
    path.write_bytes(path.read_bytes()[:-200])
    with pytest.raises(MapError, match="not a readable OSM file"):
        MapStore.open(path, folder)
    assert not folder.exists()
    folder.mkdir()
    with pytest.raises(MapError, match="not a readable OSM file"):
        MapStore.open(path, folder)
    assert not list(folder.iterdir())


def test_two_processes_may_build_at_once(tmp_path: Path) -> None:
    path, folder = town(tmp_path), tmp_path / "index"
    command = [sys.executable, "-m", "tests.world_gen.measure_index", str(path), str(folder)]
    builders = [subprocess.Popen(command, stdout=subprocess.PIPE, text=True) for _ in range(2)]
    reports = [json.loads(builder.communicate(timeout=240)[0]) for builder in builders]
    assert [r["ways"] for r in reports] == [8, 8]
    assert len(list(folder.glob("*.mapindex"))) == 1
    assert not list(folder.glob("building-*"))
    assert_same(MapStore.open(path, folder).clip(EVERYWHERE), read_map(path))


def test_who_names_no_map_to_measure_is_told_how() -> None:
    command = [sys.executable, "-m", "tests.world_gen.measure_index"]
    done = subprocess.run(command, capture_output=True, text=True, timeout=240)
    assert (done.returncode, done.stderr.splitlines()[0][:6]) == (1, "usage:")


def measured(path: Path, folder: Path, *shrink: int) -> dict[str, float]:
    command = [sys.executable, "-m", "tests.world_gen.measure_index", str(path), str(folder)]
    done = subprocess.run(
        [*command, *map(str, shrink)], check=True, capture_output=True, text=True, timeout=900
    )
    report: dict[str, float] = json.loads(done.stdout)
    return report


def test_memory_does_not_grow_with_the_map(tmp_path: Path) -> None:
    # With batches far smaller than the maps: what is held must not depend on the map's size.
    peaks = []
    for megabytes in (6, 20):
        path = tmp_path / f"{megabytes}.osm"
        write_large_map(path, megabytes * 1_000_000)
        report = measured(path, tmp_path / "index", 64)
        peaks.append(report["peak_bytes"])
        path.unlink()
    assert peaks[1] - peaks[0] < 0.3 * 14_000_000, peaks


@pytest.mark.judge
@pytest.mark.timeout(1500)
def test_a_gigabyte_needs_less_than_one_of_memory(tmp_path: Path) -> None:
    path = tmp_path / "large.osm"
    write_large_map(path, 1_000_000_000)
    report = measured(path, tmp_path / "index")
    per_gb = report["seconds"] / (path.stat().st_size / 1e9)
    print(f"{per_gb:.0f} s per GB of XML, {report}")
    assert report["peak_bytes"] + report["decoder_peak_bytes"] < 1 << 30
    store = MapStore.open(path, tmp_path / "index")
    clip = store.clip(LatLonBounds(45.0, 5.0, 45.015, 5.015))
    assert len(find_intersections(clip, build_road_graph(clip))) > 50


@pytest.mark.real_data
@pytest.mark.parametrize(
    ("name", "every"),
    [
        ("osm-badhersfeld/badhersfeld.osm.xml.gz", 400),
        ("osm-liechtenstein/liechtenstein-latest.osm.pbf", 700),
    ],
)
def test_worlds_of_a_clip_are_those_of_the_whole_map(
    data_dir: Path, tmp_path: Path, name: str, every: int
) -> None:
    osm = read_map(data_dir / name)
    store = MapStore.open(data_dir / name, tmp_path / "index")
    assert_same(store.clip(EVERYWHERE), osm)
    graph = build_road_graph(osm)
    junctions = sorted(find_intersections(osm, graph), key=lambda j: j.summary.id)
    index = index_map(osm, graph, junctions)
    for junction in junctions[::every]:
        lat, lon = junction.summary.lat, junction.summary.lon
        north = 600.0 / METRES_PER_DEG
        east = north / math.cos(math.radians(lat))
        clip = store.clip(LatLonBounds(lat - north, lon - east, lat + north, lon + east))
        of_clip = build_road_graph(clip)
        near = find_intersections(clip, of_clip)
        (same,) = (j for j in near if j.summary.id == junction.summary.id)
        world = build_world(osm, graph, junction, index=index)
        again = build_world(clip, of_clip, same, index=index_map(clip, of_clip, near))
        assert again.id == world.id, junction.summary
