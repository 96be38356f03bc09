"""The table of formats: each writes what its name says, with the map's makers in it."""

from __future__ import annotations

from pathlib import Path

import pytest

from foretwin.contracts.world import ATTRIBUTION, World
from foretwin.world_gen.export.choices import OPENDRIVE_VERSIONS, SIMULATORS
from foretwin.world_gen.export.formats import FORMATS, ExportOptions, formats_by_suffix
from tests.world_gen.drawn_maps import crossing, world_of
from tests.world_gen.export.test_sdformat import ALL_KINDS, CAR

COVERS = ("foretwin.world_gen.export.choices",)
BEGINS = {
    "mjcf": "<mujoco",
    "sdf": "<sdf",
    "opendrive": "<OpenDRIVE",
    "lanelet2": "<osm",
    "commonroad": "<commonRoad",
    "geojson": '{"type":"FeatureCollection"',
    "svg": "<svg",
}


@pytest.fixture(scope="module")
def world() -> World:
    return world_of(crossing())


def written(world: World, name: str, tmp_path: Path, options: ExportOptions) -> str:
    path = tmp_path / f"world{FORMATS[name].suffix}"
    FORMATS[name].write(world, path, options)
    return path.read_text(encoding="utf-8")


@pytest.mark.parametrize("name", sorted(BEGINS))
def test_a_format_writes_its_own_kind_of_file(world, name, tmp_path):
    text = written(world, name, tmp_path, ExportOptions())
    assert BEGINS[name] in text
    assert ATTRIBUTION in text


def test_a_picture_is_written_as_png_too(world, tmp_path):
    assert set(FORMATS) == {*BEGINS, "png"}
    FORMATS["png"].write(world, tmp_path / "world.png", ExportOptions())
    assert (tmp_path / "world.png").read_bytes().startswith(b"\x89PNG")


def test_options_reach_the_writers_that_have_them(world, tmp_path):
    for version in OPENDRIVE_VERSIONS:
        options = ExportOptions(opendrive_version=version)
        text = written(world, "opendrive", tmp_path, options)
        assert f'revMinor="{version[-1]}"' in text
    for simulator in SIMULATORS:
        options = ExportOptions(simulator=simulator, vehicles=ALL_KINDS, vehicle=CAR)
        text = written(world, "sdf", tmp_path, options)
        assert ("libgazebo_ros_state.so" in text) == (simulator == "classic")
        assert all(f'<model name="{name}">' in text for name, _ in ALL_KINDS)


def test_a_suffix_of_several_formats_means_the_default_first():
    assert formats_by_suffix(".XML") == ("mjcf", "commonroad")
    assert formats_by_suffix(".txt") == ()
