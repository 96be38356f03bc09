"""A map file becomes a map, whatever its packing; what is no map says so in one line."""

from __future__ import annotations

import bz2
import gzip
import hashlib
from collections.abc import Callable
from pathlib import Path

import osmium
import pytest

from foretwin.contracts.frames import local_from_geo
from foretwin.world_gen.osm.osm_map import MapError
from foretwin.world_gen.osm.read_osm import read_map
from tests.world_gen.sketch import Sketch

COVERS = (
    "foretwin.world_gen.osm.map_file",
    "foretwin.world_gen.osm.opl",
    "foretwin.world_gen.osm.opl_filter",
    "foretwin.world_gen.osm.osm_map",
)


@pytest.fixture
def street() -> Sketch:
    sketch = Sketch()
    for node, x_m in ((1, -100.0), (2, 0.0), (3, 100.0)):
        sketch.node(node, x_m, 0.0)
    sketch.node(4, 0.0, 50.0, highway="traffic_signals")
    sketch.node(5, 20.0, 50.0)
    sketch.node(6, 20.0, 70.0, natural="tree")
    sketch.road(10, [1, 2, 3], "Seestraße", maxspeed="30")
    sketch.way(11, [4, 5, 6, 4])
    sketch.way(12, [1, 2], waterway="ditch")
    sketch.relation(20, {11: "outer"}, type="multipolygon", building="yes", height="12")
    sketch.relation(21, {12: "part"}, type="route", route="bus")
    return sketch


def test_keeps_roads_buildings_and_the_tags_of_signals(street: Sketch, tmp_path: Path) -> None:
    osm = street.read(tmp_path)
    assert list(osm.ways) == [10, 11]
    assert osm.ways[10].tags == {"highway": "residential", "name": "Seestraße", "maxspeed": "30"}
    assert osm.ways[10].nodes == (1, 2, 3)
    assert osm.node_tags == {4: {"highway": "traffic_signals"}, 6: {"natural": "tree"}}
    assert list(osm.relations) == [20]
    assert osm.relations[20].members[0].role == "outer"
    assert set(osm.locations) == {1, 2, 3, 4, 5, 6}


def test_the_frame_is_centred_on_the_roads(street: Sketch, tmp_path: Path) -> None:
    osm = street.read(tmp_path)
    lat, lon = osm.locations[2]
    assert abs(local_from_geo(osm.frame, lat, lon)).max() < 0.01


def test_every_packing_reads_the_same(street: Sketch, tmp_path: Path) -> None:
    plain = street.read(tmp_path)
    text = street.xml().encode()
    packed = {"map.osm.gz": gzip.compress(text), "map.osm.bz2": bz2.compress(text)}
    for name, data in packed.items():
        (tmp_path / name).write_bytes(data)
    with osmium.SimpleWriter(str(tmp_path / "map.osm.pbf")) as writer:
        for item in osmium.FileProcessor(str(tmp_path / "sketch.osm")):
            writer.add(item)
    for name in (*packed, "map.osm.pbf"):
        osm = read_map(tmp_path / name)
        assert osm.ways == plain.ways, name
        assert osm.relations == plain.relations, name
        assert osm.locations == plain.locations, name
        assert osm.sha256 == hashlib.sha256((tmp_path / name).read_bytes()).hexdigest()


@pytest.mark.parametrize(
    "name", ["A, B=50% @ C", "Große Straße\u00a0\N{TRAM CAR}", "%20%", "=,=", "x y"]
)
def test_any_character_of_a_tag_survives(name: str, tmp_path: Path) -> None:
    sketch = Sketch()
    sketch.node(1, 0.0, 0.0, highway="stop", note=name)
    sketch.node(2, 50.0, 0.0)
    sketch.road(10, [1, 2], name)
    sketch.relation(20, {10: name}, type="restriction", restriction=name)
    osm = sketch.read(tmp_path)
    assert osm.ways[10].tags["name"] == name
    assert osm.node_tags[1]["note"] == name
    assert osm.relations[20].tags["restriction"] == name
    assert osm.relations[20].members[0].role == name


def test_a_name_that_hides_the_packing_does_no_harm(street: Sketch, tmp_path: Path) -> None:
    path = tmp_path / "export.xml"
    path.write_bytes(gzip.compress(street.xml().encode()))
    assert list(read_map(path).ways) == [10, 11]


def test_bounds_are_the_declared_ones_else_those_of_the_roads(tmp_path: Path) -> None:
    declared = Sketch(bounds='<bounds minlat="53.48" minlon="8.08" maxlat="53.52" maxlon="8.12"/>')
    free = Sketch()
    for sketch in (declared, free):
        sketch.node(1, 0.0, 0.0)
        sketch.node(2, 100.0, 100.0)
        sketch.road(10, [1, 2])
    assert tuple(declared.read(tmp_path).bounds) == (53.48, 8.08, 53.52, 8.12)
    bounds = free.read(tmp_path).bounds
    assert bounds.south == pytest.approx(53.5, abs=1e-6)
    assert 100.0 / 111_500 < bounds.north - bounds.south < 100.0 / 111_000


def test_ids_below_zero_of_an_editor_are_read(tmp_path: Path) -> None:
    sketch = Sketch()
    sketch.node(-1, 0.0, 0.0)
    sketch.node(-2, 50.0, 0.0)
    sketch.road(-10, [-1, -2])
    assert read_map_nodes(sketch, tmp_path) == (-1, -2)


def read_map_nodes(sketch: Sketch, folder: Path) -> tuple[int, ...]:
    return next(iter(sketch.read(folder).ways.values())).nodes


def test_nodes_that_the_file_lacks_are_left_out(tmp_path: Path) -> None:
    sketch = Sketch()
    for node in (1, 2, 4, 5, 6):
        sketch.node(node, 10.0 * node, 0.0)
    sketch.road(10, [1, 2, 3, 4, 5, 6, 7])
    sketch.road(11, [6, 8])
    osm = sketch.read(tmp_path)
    assert osm.ways[10].nodes == (4, 5, 6)
    assert 11 not in osm.ways


@pytest.mark.parametrize(
    ("content", "complaint"),
    [
        (b"", "not an OSM file"),
        (b"latitude,longitude\n1,2\n", "not an OSM file"),
        (b'<?xml version="1.0"?><gpx></gpx>', "not an OSM file"),
        (b'<?xml version="1.0"?><osm version="0.6"><node id="1"', "not a readable OSM file"),
        (gzip.compress(b"hello", mtime=0), "not a readable OSM file"),
        (b'<?xml version="1.0"?><osm version="0.6"></osm>', "holds no roads"),
    ],
)
def test_what_is_no_map_says_so_in_one_line(content: bytes, complaint: str, tmp_path: Path) -> None:
    path = tmp_path / "broken.osm"
    path.write_bytes(content)
    with pytest.raises(MapError, match=complaint) as caught:
        read_map(path)
    message = str(caught.value)
    assert message.startswith(str(path))
    assert "\n" not in message


@pytest.mark.parametrize("pack", [gzip.compress, bz2.compress])
def test_a_packing_that_was_cut_off_is_said_to_be_so(
    pack: Callable[[bytes], bytes], street: Sketch, tmp_path: Path
) -> None:
    packed = pack(street.xml().encode())
    file = tmp_path / "cut.osm"
    file.write_bytes(packed[: len(packed) // 2])
    with pytest.raises(MapError, match=r"cut off or damaged: [^:]*[a-z]") as caught:
        read_map(file)
    assert not str(caught.value).endswith(":")


def test_a_missing_file_and_a_folder_are_named(tmp_path: Path) -> None:
    with pytest.raises(MapError, match=r"nowhere\.osm: there is no such map file"):
        read_map(tmp_path / "nowhere.osm")
    with pytest.raises(MapError, match="is a folder"):
        read_map(tmp_path)
