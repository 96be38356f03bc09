"""Steep junctions of Monaco, with SRTM's heights, before the judges of exports."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from foretwin.contracts.world import World
from foretwin.orchestrator.worlds.opening import open_map
from foretwin.world_gen.build import build_world
from foretwin.world_gen.elevation.read_dem import read_dem
from foretwin.world_gen.export.opendrive import write_opendrive
from foretwin.world_gen.export.sdformat import write_sdf
from foretwin.world_gen.junctions.map_index import index_map
from tests.world_gen.export.test_opendrive_judges import judge as judged_opendrive
from tests.world_gen.export.test_sdformat_judged import judged as judged_sdf

pytestmark = [pytest.mark.judge, pytest.mark.real_data, pytest.mark.timeout(1200)]
STEEP = ("n25197491", "n1347559083", "n819783231", "n25239343", "n21930579")
"""A street up a hillside, a ring in tunnels, serpentines, terraces, and bridges."""


@pytest.fixture(scope="module")
def worlds(data_dir: Path) -> list[World]:
    opened = open_map(data_dir / "osm-monaco" / "monaco.osm.gz")
    dem = read_dem(data_dir / "dem-monaco")
    index = index_map(opened.osm, opened.graph, opened.junctions, dem=dem)
    chosen = {j.summary.id: j for j in opened.junctions}
    return [build_world(opened.osm, opened.graph, chosen[name], index=index) for name in STEEP]


def script(name: str) -> Path:
    folder = os.environ.get("FORETWIN_JUDGES")
    if not folder:
        pytest.skip("FORETWIN_JUDGES is not set: no judges of exports here")
    return Path(folder) / name


@pytest.mark.parametrize("version", ["1.8", "1.4"])
def test_opendrive_with_heights_has_no_issue(
    worlds: list[World], tmp_path: Path, version: str
) -> None:
    for world in worlds:
        file = tmp_path / f"{world.intersection.id}.xodr"
        write_opendrive(world, file, version=version)  # type: ignore[arg-type]
        found = judged_opendrive(script("opendrive.sh"), file)
        assert (found.issues, found.imported) == (0, True)


def test_libsdformat_takes_hills(worlds: list[World], tmp_path: Path) -> None:
    for world in worlds:
        write_sdf(world, tmp_path / f"{world.intersection.id}.sdf")
    told = judged_sdf(script("sdf.sh"), *sorted(tmp_path.glob("*.sdf")))
    assert told.count("errors 0 worlds 1") == len(worlds)
