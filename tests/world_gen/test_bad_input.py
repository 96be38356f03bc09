"""Whatever a map file holds: a note that names the object, or one clear line; never a crash."""

from __future__ import annotations

import bz2
import contextlib
import gzip
import tempfile
from pathlib import Path

import osmium
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from foretwin.world_gen.osm.osm_map import LatLonBounds, MapError
from foretwin.world_gen.osm.read_osm import read_map
from tests.world_gen.chain import build_all
from tests.world_gen.map_files import both_ways, crossing, file_of, refused


def pbf_of(path: Path, options: str = "pbf") -> bytes:
    target = path.with_suffix(".osm.pbf")
    with osmium.SimpleWriter(osmium.io.File(target, options)) as writer:
        for item in osmium.FileProcessor(str(path)):
            writer.add(item)
    return target.read_bytes()


@pytest.mark.parametrize("packing", ["xml", "gz", "bz2", "pbf"])
@pytest.mark.parametrize("part", [0.3, 0.9])
def test_a_truncated_file_is_refused(tmp_path: Path, packing: str, part: float) -> None:
    plain = file_of(tmp_path, crossing())
    text = plain.read_bytes()
    data = {"xml": text, "gz": gzip.compress(text), "bz2": bz2.compress(text)}.get(packing)
    data = pbf_of(plain) if data is None else data
    path = file_of(tmp_path, data[: int(part * len(data))], "cut")
    refused(path, tmp_path, "not a readable OSM file|not an OSM file")


DAMAGE = st.lists(
    st.tuples(st.floats(0.0, 1.0, exclude_max=True), st.sampled_from("sdi"), st.binary(max_size=9)),
    min_size=1,
    max_size=9,
)


@settings(max_examples=80, derandomize=True)
@given(st.sampled_from(["xml", "gz", "pbf", "loose pbf"]), DAMAGE)
def test_a_damaged_file_is_read_or_refused(
    packing: str, damage: list[tuple[float, str, bytes]]
) -> None:
    with tempfile.TemporaryDirectory() as name:
        plain = file_of(Path(name), crossing())
        text = plain.read_bytes()
        if packing in ("xml", "gz"):
            data = gzip.compress(text) if packing == "gz" else text
        else:
            data = pbf_of(plain, "pbf" if packing == "pbf" else "pbf,pbf_compression=none")
        for where, how, what in damage:
            at = int(where * len(data))
            end = at + len(what) if how in "sd" else at
            data = data[:at] + (b"" if how == "d" else what) + data[end:]
        path = file_of(Path(name), data, "damaged")
        # Osmium ends the whole process where its writer has failed and is destroyed.
        with contextlib.suppress(MapError):
            read_map(path)


def test_an_empty_file_is_no_map(tmp_path: Path) -> None:
    refused(file_of(tmp_path, b""), tmp_path, "not an OSM file")


def test_entities_that_multiply_are_never_expanded(tmp_path: Path) -> None:
    names = '<!ENTITY a0 "lol">' + "".join(
        f'<!ENTITY a{i} "{f"&a{i - 1};" * 10}">' for i in range(1, 12)
    )
    bomb = crossing().xml().replace("<osm ", f"<!DOCTYPE osm [{names}]>\n<osm ")
    bomb = bomb.replace("Arm 2", "&a11;")
    refused(file_of(tmp_path, bomb), tmp_path, "entities are not supported")


@pytest.mark.parametrize("kind", ["general", "parameter"])
def test_external_entities_are_never_read(tmp_path: Path, kind: str) -> None:
    secret = file_of(tmp_path, "The secret", "secret.txt").as_uri()
    declared = f'<!ENTITY x SYSTEM "{secret}">'
    if kind == "parameter":
        declared = f'<!ENTITY % x SYSTEM "{secret}"> %x;'
    text = crossing().xml().replace("<osm ", f"<!DOCTYPE osm [{declared}]>\n<osm ")
    refused(file_of(tmp_path, text), tmp_path, "entities are not supported")


def test_a_doctype_that_names_a_file_opens_nothing(tmp_path: Path) -> None:
    text = crossing().xml().replace("<osm ", '<!DOCTYPE osm SYSTEM "/dev/zero">\n<osm ')
    osm = both_ways(file_of(tmp_path, text), tmp_path)
    assert len(osm.ways) == 4


def test_names_that_are_not_utf8(tmp_path: Path) -> None:
    text = crossing().xml().encode().replace(b"Arm 2", b"Stra\xdfe")
    refused(file_of(tmp_path, text), tmp_path, "not a readable OSM file")


def test_names_that_are_not_utf8_in_pbf(tmp_path: Path) -> None:
    plain = file_of(tmp_path, crossing())
    loose = pbf_of(plain, "pbf,pbf_compression=none")
    assert loose.count(b"Arm 2") == 1
    path = file_of(tmp_path, loose.replace(b"Arm 2", b"A\xff\xfe 2"), "names.osm.pbf")
    refused(path, tmp_path, "not a readable OSM file")


def test_nodes_that_are_missing_are_named(tmp_path: Path) -> None:
    sketch = crossing()
    sketch.road(200, [2, 901, 3, 4], "Gap")
    sketch.road(201, [2, 902], "Gone")
    sketch.way(202, [3, 903, 904, 905, 906, 3], building="yes")
    osm = both_ways(file_of(tmp_path, sketch), tmp_path)
    assert osm.notes == (
        "way 200: the map lacks its node 901; 2 of its 4 nodes are kept",
        "way 201: the map lacks its node 902; left out",
        "way 202: the map lacks its nodes 903, 904, 905 and 1 more; left out",
    )
    assert osm.ways[200].nodes == (3, 4)
    assert osm.notes_within(LatLonBounds(53.4, 8.0, 53.6, 8.2)) == osm.notes
    assert not osm.notes_within(LatLonBounds(53.6, 8.0, 53.7, 8.2))
    assert build_all(tmp_path / "map.osm").worlds


def test_a_node_that_stands_twice_is_named(tmp_path: Path) -> None:
    sketch = crossing()
    sketch.node(2, 150.0, 1.0)
    sketch.way(102, [1, 2], highway="residential", name="Again")
    osm = read_map(file_of(tmp_path, sketch))
    assert "node 2: stands in the file more than once; its last position is used" in osm.notes
    assert "way 102: stands in the file more than once; the last is used" in osm.notes
    assert osm.ways[102].tags["name"] == "Again"
    assert len(build_all(tmp_path / "map.osm").worlds) == 1


def test_nodes_on_one_another_and_ways_without_length(tmp_path: Path) -> None:
    sketch = crossing()
    for node in (10, 11, 12):
        sketch.node(node, 0.0, 0.0)
    sketch.node(13, 80.0, 80.0)
    sketch.node(14, 80.0, 80.0)
    sketch.road(200, [10, 11], "None")
    sketch.road(201, [12, 12], "None")
    sketch.road(202, [1], "None")
    sketch.road(203, [], "None")
    sketch.road(204, [1, 13, 14, 2], "Loop")
    osm = both_ways(file_of(tmp_path, sketch), tmp_path)
    assert "way 200: has no length; left out" in osm.notes
    assert "way 201: has no length; left out" in osm.notes
    assert "way 202: has fewer than two nodes; left out" in osm.notes
    assert "way 203: has fewer than two nodes; left out" in osm.notes
    assert build_all(tmp_path / "map.osm").worlds
