"""The command `world` refuses in one line, naming what is wrong, before anything is written."""

from __future__ import annotations

from pathlib import Path

import pytest

from foretwin.orchestrator.commands.cli import run
from foretwin.orchestrator.embedded import MAP_FILE
from foretwin.world_gen.export.formats import FORMATS

MAP = str(MAP_FILE)

WRONG = [
    ([], "exactly one of --at"),
    (["--at", "45,-30", "--all"], "--at and --all"),
    (["--at", "45"], "LAT,LON"),
    (["--at", "north,west"], "LAT,LON"),
    (["--at", "95,-30"], "latitude -90 to 90"),
    (["--at", "nan,-30"], "LAT,LON"),
    (["--at", "46,-30"], "nearest intersection"),
    (["--at", "-30,45"], "more than 200; latitude comes first: 45.0,-30.0?"),
    (["--id", "nowhere"], "nowhere"),
    (["--id", "n1"], "holds no such intersection"),
    (["--bbox", "1,2,3"], "W,S,E,N"),
    (["--bbox", "a,b,c,d"], "W,S,E,N"),
    (["--bbox", "7,50,8,51"], "outside"),
    (["--bbox", "-29.996,44.998,-30.004,45.002"], "west must be less than east"),
    (["--bbox", "179.9,-17.1,-179.9,-16.9"], "antimeridian"),
    (["--bbox", "-30.004,45.002,-29.996,44.998"], "south must be less than north"),
    (["--bbox", "-30.004,44.998,-29.996,95"], "latitudes"),
    (["--bbox", "-30.004,44.998,200,45"], "longitudes"),
    (["--all", "--format", "stl"], "mjcf, sdf, opendrive, lanelet2, commonroad, geojson, svg, png"),
    (["--all", "--radius", "5"], "20 to 2000"),
    (["--all", "--radius", "nan"], "20 to 2000"),
    (["--bbox", "7,50,8,51", "--radius", "80"], "--radius 80: goes with junctions"),
    (["--all", "--format", "opendrive", "--opendrive-version", "1.9"], "1.8, 1.4"),
    (["--all", "--format", "sdf", "--simulator", "carla"], "classic, gazebo"),
    (["--all", "--format", "sdf", "--vehicles", "ego:car"], "twin, shadow, ghost"),
    (["--all", "--format", "sdf", "--vehicles", "a:twin,a:ghost"], "a name of its own"),
    (["--all", "--format", "sdf", "--vehicle", "no.toml"], "no.toml"),
    (["--route", "no.gpx"], "no.gpx"),
    (["--id", "n4", "--simulator", "gazebo"], "--simulator gazebo: goes with the format sdf alone"),
    (["--id", "n4", "--vehicles", "none"], "world.xml is written as mjcf"),
    (["--id", "n4", "--vehicle", "bmw_320i"], "--vehicle bmw_320i: goes with the format sdf"),
    (["--id", "n4", "--opendrive-version", "1.4"], "goes with the format opendrive alone"),
    (["--id", "n4", "--lanelet2-dialect", "autoware"], "goes with the format lanelet2 alone"),
    (["--all", "--format", "lanelet2", "--lanelet2-dialect", "apollo"], "lanelet2, autoware"),
    (
        ["--all", "--format", "sdf", "--vehicles", "none", "--vehicle", "bmw_320i"],
        "--vehicle bmw_320i: there is none, by --vehicles none",
    ),
    (["--all", "--format", "sdf", "--vehicles", ""], "none, or NAME:KIND"),
]


@pytest.mark.parametrize(("arguments", "named"), WRONG, ids=[" ".join(a) for a, _ in WRONG])
def test_what_cannot_be_meant_is_named_in_one_line(
    arguments: list[str], named: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = "world" if {"--all", "--route"} & set(arguments) else "world.xml"
    code = run(["world", MAP, *arguments, "--out", str(tmp_path / out)])
    error = capsys.readouterr().err.strip()
    assert code == 2, error
    assert "\n" not in error
    assert named in error


def test_an_output_that_cannot_be_is_named(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "file"
    file.touch()
    for arguments, named in (
        (["--all", "--out", str(file)], "is a file"),
        (["--at", "45,-30", "--out", str(tmp_path)], "is a folder"),
        (["--at", "45,-30", "--out", str(tmp_path / "no" / "w.xml")], "does not exist"),
        (["--at", "45,-30", "--format", "svg", "--out", str(tmp_path / "w.png")], "ends in .svg"),
        (["--at", "45,-30", "--format", "mjcf", "--out", str(tmp_path / "w.png")], "ends in .xml"),
        (["--at", "45,-30", "--format", "sdf", "--out", str(tmp_path / "w.OSM")], "ends in .sdf"),
        (["--at", "45,-30", "--out", str(tmp_path / "w.gltf")], "ends in none of .xml, .sdf, "),
        (["--at", "45,-30", "--out", str(tmp_path / "w")], "ends in none of .xml, .sdf, "),
        (["--all", "--out", str(tmp_path / "w.xodr")], "w.xodr: is named as a file"),
        (["--all", "--out", str(file / "worlds")], "is no folder"),
    ):
        assert run(["world", MAP, *arguments]) == 2
        said = capsys.readouterr().err
        assert named in said
        assert said.count("\n") == 1
    assert list(tmp_path.iterdir()) == [file]


@pytest.mark.parametrize(
    "arguments",
    [["--all", "--out", "/proc/new/worlds"], ["--at", "45,-30", "--out", "/proc/world.xml"]],
)
def test_a_folder_that_cannot_be_written_to_is_named_before_the_map_is_read(
    arguments: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(["world", "no.osm", *arguments]) == 2
    assert "folder /proc cannot be written to" in capsys.readouterr().err


@pytest.mark.parametrize("linked", [False, True], ids=["the map", "a link to the map"])
def test_the_map_itself_is_not_written_over(
    linked: bool, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    town = tmp_path / "town.osm"
    town.write_bytes(MAP_FILE.read_bytes())
    out = tmp_path / "linked.osm" if linked else town
    if linked:
        out.symlink_to(town)
    assert run(["world", str(town), "--at", "45,-30", "--out", str(out)]) == 2
    assert "is the map itself" in capsys.readouterr().err
    assert town.read_bytes() == MAP_FILE.read_bytes()


def test_a_wrong_map_leaves_no_folder_behind(tmp_path: Path) -> None:
    assert run(["world", "no.osm", "--all", "--out", str(tmp_path / "worlds")]) == 2
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("file_format", ["mjcf", "sdf", "opendrive", "lanelet2", "commonroad",
                                         "geojson", "svg"])  # fmt: skip
def test_every_format_names_the_file_that_cannot_be_written(
    file_format: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    # Past all checks: a link to nowhere takes no file, whoever writes it.
    out = tmp_path / f"world{FORMATS[file_format].suffix}"
    out.symlink_to(tmp_path / "no" / "folder")
    arguments = ["--at", "45,-30", "--format", file_format, "--out", str(out)]
    assert run(["world", MAP, *arguments]) == 2
    error = capsys.readouterr().err.strip()
    assert out.name in error
    assert "\n" not in error
