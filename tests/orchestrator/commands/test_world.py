"""The command `world`: what it writes for a place, a route or a whole map; what it refuses."""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
import pytest
from lxml import etree

from foretwin.contracts.errors import UserError
from foretwin.contracts.world import World
from foretwin.orchestrator.commands.cli import run
from foretwin.orchestrator.embedded import MAP_FILE, ROUTE_FILE
from foretwin.orchestrator.worlds.choice import node_of_id
from foretwin.orchestrator.worlds.opening import open_map
from foretwin.world_gen.build import build_world
from foretwin.world_gen.export.formats import FORMATS
from foretwin.world_gen.opening import Clip, NodeClip, region_on_map
from foretwin.world_gen.osm.osm_map import LatLonBounds
from tests.world_gen.sketch import Sketch

COVERS = (
    "foretwin.orchestrator.worlds.opening",
    "foretwin.world_gen.opening",
)

MAP = str(MAP_FILE)
TOWN = "-30.004,44.998,-29.996,45.002"
"""Bounds in the middle of the drawn town."""


def a_junction() -> str:
    return open_map(MAP_FILE).junctions[0].summary.id


HOLDS = {
    ".xml": b"<mujoco", ".sdf": b"<sdf", ".xodr": b"<OpenDRIVE", ".osm": b"<osm",
    ".geojson": b"FeatureCollection", ".svg": b"<svg", ".png": b"PNG", ".PNG": b"PNG",
}  # fmt: skip


@pytest.mark.parametrize("suffix", HOLDS)
def test_a_file_holds_what_its_suffix_says(suffix: str, tmp_path: Path) -> None:
    assert {one.suffix for one in FORMATS.values()} <= HOLDS.keys()
    out = tmp_path / f"world{suffix}"
    assert run(["world", MAP, "--id", a_junction(), "--out", str(out)]) == 0
    assert HOLDS[suffix] in out.read_bytes()[:2000]


def test_a_suffix_of_none_is_free_where_the_format_is_named(tmp_path: Path) -> None:
    out = tmp_path / "town.world"
    arguments = ["--id", a_junction(), "--format", "sdf", "--out", str(out)]
    assert run(["world", MAP, *arguments]) == 0
    assert b"<sdf" in out.read_bytes()


@pytest.mark.parametrize("name", sorted(FORMATS))
def test_every_format_is_written(
    name: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / f"world{FORMATS[name].suffix}"
    code = run(["world", MAP, "--id", a_junction(), "--format", name, "--out", str(out)])
    said = capsys.readouterr()
    assert code == 0, said.err
    assert str(out) in said.out
    assert out.stat().st_size > 500


def test_an_sdf_has_the_vehicles_that_were_asked_for(tmp_path: Path) -> None:
    out = tmp_path / "world.sdf"
    place = ["world", MAP, "--id", a_junction(), "--format", "sdf", "--out", str(out)]
    assert run([*place, "--vehicles", "ego:twin,real:shadow", "--simulator", "gazebo"]) == 0
    models = {model.get("name") for model in etree.parse(str(out)).iter("model")}
    assert {"ego", "real"} <= models
    assert run([*place, "--vehicles", "none"]) == 0
    models = {model.get("name") for model in etree.parse(str(out)).iter("model")}
    assert models == {"ground", "road", "markings", "signals", "buildings"}


@pytest.mark.real_data
def test_a_clipped_map_gives_the_same_worlds(
    data_dir: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    file = data_dir / "osm-monaco" / "monaco.osm.gz"
    whole = open_map(file)
    for junction in whole.junctions[::25]:
        place = junction.summary
        world = build_world(whole.osm, whole.graph, junction)
        for clip in (
            Clip(np.array([[place.lat, place.lon]]), 150.0),
            NodeClip(node_of_id(place.id), 150.0),
        ):
            part = open_map(file, clip=clip, large_bytes=0)
            assert len(part.osm.ways) < len(whole.osm.ways)
            same = next(j for j in part.junctions if j.summary.id == place.id)
            assert build_world(part.osm, part.graph, same).id == world.id, place


def test_of_a_large_map_a_junction_is_clipped_by_its_id(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    for junction in open_map(MAP_FILE).junctions:
        clip = NodeClip(node_of_id(junction.summary.id), 0.0)
        part = open_map(MAP_FILE, clip=clip, large_bytes=0)
        assert junction.summary in [near.summary for near in part.junctions]


@pytest.mark.parametrize(
    ("clip", "complaint"),
    [
        (NodeClip(123456, 0.0), "no way has a node 123456"),
        (Clip(np.array([[10.0, 10.0]]), 0.0), "no road at the place asked for; the map spans -30"),
    ],
)
def test_what_a_large_map_does_not_hold_is_named(
    clip: Clip | NodeClip, complaint: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    with pytest.raises(UserError, match=complaint):
        open_map(MAP_FILE, clip=clip, large_bytes=0)


def test_bounds_make_one_world_of_a_region(tmp_path: Path) -> None:
    out = tmp_path / "town.geojson"
    assert run(["world", MAP, "--bbox", TOWN, "--format", "geojson", "--out", str(out)]) == 0
    collection = json.loads(out.read_text(encoding="utf-8"))
    assert collection["world"]["intersection"]["kind"] == "region"
    kinds = [feature["properties"]["kind"] for feature in collection["features"]]
    assert kinds.count("junction") > 1


def test_bounds_beyond_the_map_end_where_it_ends(tmp_path: Path) -> None:
    out = tmp_path / "town.geojson"
    wide = ["--bbox", "-40,44,-29.99,60", "--format", "geojson", "--out", str(out)]
    assert run(["world", MAP, *wide]) == 0
    lon, lat = json.loads(out.read_text(encoding="utf-8"))["world"]["origin"]
    assert abs(lat - 45.0) < 0.02
    assert abs(lon + 30.0) < 0.02


def test_a_region_is_no_larger_than_a_plane_can_be() -> None:
    country = LatLonBounds(south=47.0, west=6.0, north=55.0, east=15.0)
    town = LatLonBounds(south=50.0, west=9.0, north=50.2, east=9.2)
    assert region_on_map(MAP_FILE, country, town) == town
    with pytest.raises(UserError, match="at most 50 km"):
        region_on_map(MAP_FILE, country, country)


def test_all_junctions_are_written_by_their_ids(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "new" / "worlds"
    assert run(["world", MAP, "--all", "--format", "geojson", "--out", str(out)]) == 0
    ids = {junction.summary.id for junction in open_map(MAP_FILE).junctions}
    assert {path.stem for path in out.iterdir()} == ids
    assert f"{len(ids)} of {len(ids)} Worlds written" in capsys.readouterr().out


def test_a_route_writes_the_junctions_along_it(tmp_path: Path) -> None:
    out = tmp_path / "worlds"
    arguments = ["--route", str(ROUTE_FILE), "--format", "geojson", "--out", str(out)]
    assert run(["world", MAP, *arguments]) == 0
    kinds = [
        json.loads(path.read_text(encoding="utf-8"))["world"]["intersection"]["kind"]
        for path in out.iterdir()
    ]
    assert sorted(kinds) == ["crossing", "crossing", "roundabout", "t_junction"]


def drawn_yard(folder: Path) -> tuple[Path, Path]:
    """A street with two driveways, and a route that turns into the first."""
    sketch = Sketch()
    for node, x_m, y_m in (
        (1, -200.0, 0.0), (2, 0.0, 0.0), (3, 100.0, 0.0), (4, 200.0, 0.0),
        (5, 0.0, 80.0), (6, 100.0, 80.0),
    ):  # fmt: skip
        sketch.node(node, x_m, y_m)
    sketch.road(10, [1, 2, 3, 4], "Street")
    sketch.road(11, [2, 5], highway="service")
    sketch.road(12, [3, 6], highway="service")
    osm = sketch.read(folder)
    line = [osm.locations[node][::-1] for node in (1, 2, 5)]
    route = folder / "route.geojson"
    route.write_text(json.dumps({"type": "LineString", "coordinates": line}), encoding="utf-8")
    return Path(osm.file), route


def listed(capsys: pytest.CaptureFixture[str], *arguments: str) -> list[str]:
    capsys.readouterr()
    assert run(["intersections", *arguments, "--json"]) == 0
    return [junction["id"] for junction in json.loads(capsys.readouterr().out)]


def test_driveways_make_junctions_by_option_and_where_a_route_uses_them(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    map_file, route = (str(path) for path in drawn_yard(tmp_path))
    assert listed(capsys, map_file) == []
    assert listed(capsys, map_file, "--service-roads") == ["n2", "n3"]
    assert listed(capsys, map_file, "--route", route) == ["n2"]

    out = tmp_path / "worlds"
    common = ["--format", "geojson", "--out", str(out)]
    assert run(["world", map_file, "--all", *common]) == 2
    assert "no intersection" in capsys.readouterr().err
    assert run(["world", map_file, "--route", route, *common]) == 0
    (world,) = out.iterdir()
    assert world.stem == "n2"
    # The other driveway has lanes in no World but one that asks for all.
    assert service_ways(world) == {11}
    assert run(["world", map_file, "--all", "--service-roads", *common]) == 0
    assert {path.stem for path in out.iterdir()} == {"n2", "n3"}
    assert service_ways(world) == {11, 12}


def service_ways(world: Path) -> set[int]:
    """The ways 11 and 12 among those whose lanes a GeoJSON World holds."""
    features = json.loads(world.read_text(encoding="utf-8"))["features"]
    lanes = (f["properties"] for f in features if f["properties"]["kind"] == "lane")
    return {lane["osm_way"] for lane in lanes} & {11, 12}


def test_a_report_says_beside_the_file_what_was_guessed(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "world.geojson"
    place = ["world", MAP, "--id", a_junction(), "--format", "geojson", "--out", str(out)]
    assert run([*place, "--report"]) == 0
    said = capsys.readouterr().out
    told = json.loads((tmp_path / "world.geojson.report.json").read_text(encoding="utf-8"))
    assert told["junctions"][0]["id"] == a_junction()
    assert told["attribution"] in said
    assert told["attribution"] in (tmp_path / "world.geojson.report.md").read_text("utf-8")


def test_what_one_world_lacks_is_told_below_its_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Roads leave the town's roundabout farther out than its World reaches."""
    place = ["world", MAP, "--id", "n11", "--radius", "20", "--out", str(tmp_path / "ring.svg")]
    assert run(place) == 0
    line, *kinds = capsys.readouterr().out.splitlines()
    assert ", 4 notes. " in line
    assert kinds == [
        "       4  begins beyond the World, … m about the junction; left out, with its turns"
    ]
    assert run([*place, "--report"]) == 0
    assert capsys.readouterr().out.count("begins beyond the World, … m") == 1


def test_notes_are_counted_as_the_report_counts_them(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """What one note names as a list counts each, as in the picture."""
    written = tmp_path / "ring.svg"
    for notes, counted in ((["left out: w1"], "1 note."), (["left out: w1, w2, w3"], "3 notes.")):
        build = partial(_with_notes, build_world, notes)
        monkeypatch.setattr("foretwin.orchestrator.commands.world.build_world", build)
        assert run(["world", MAP, "--id", "n11", "--out", str(written)]) == 0
        line, kind = capsys.readouterr().out.splitlines()
        assert f", {counted} " in line
        assert kind.split() == [counted[0], "left", "out"]
        assert f"note: left out ({counted[0]})" in written.read_text(encoding="utf-8")


def _with_notes(build: Callable[..., World], notes: list[str], *args: Any, **more: Any) -> World:
    return msgspec.structs.replace(build(*args, **more), notes=tuple(notes))


def test_each_of_many_worlds_has_its_report(tmp_path: Path) -> None:
    arguments = ["--route", str(ROUTE_FILE), "--format", "geojson", "--out", str(tmp_path)]
    assert run(["world", MAP, *arguments, "--report"]) == 0
    worlds = list(tmp_path.glob("*.geojson"))
    assert len(worlds) == 4
    for world in worlds:
        assert world.with_name(f"{world.name}.report.md").exists()
        assert world.with_name(f"{world.name}.report.json").exists()


def test_help_needs_none_of_the_rooms() -> None:
    code = (
        "import sys\nfrom foretwin.orchestrator.commands.cli import run\nrun(['world', '--help'])\n"
        "heavy = {'numpy', 'mujoco', 'shapely', 'osmium', 'lxml', 'zenoh', 'rerun'}\n"
        "sys.exit(sorted(heavy & set(sys.modules)).__repr__() if heavy & set(sys.modules) else 0)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert "--bbox" in done.stdout
