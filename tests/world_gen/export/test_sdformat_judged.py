"""SDFormat files before libsdformat, which refuses whatever its schema does not know."""

from __future__ import annotations

import os
import subprocess
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
import pytest
import shapely

from foretwin.contracts.beside_road import Building
from foretwin.contracts.provenance import Quantity
from foretwin.world_gen.export.sdformat import write_sdf
from foretwin.world_gen.export.sdformat_vehicles import place_vehicles
from tests.world_gen.drawn_maps import crossing, world_of
from tests.world_gen.export.judged_sample import sample_worlds
from tests.world_gen.export.test_sdformat import ALL_KINDS, CAR, built

pytestmark = pytest.mark.judge


@pytest.fixture(scope="module")
def judge() -> Path:
    folder = os.environ.get("FORETWIN_JUDGES")
    if not folder:
        pytest.skip("FORETWIN_JUDGES is not set: no libsdformat to judge SDFormat files")
    return Path(folder) / "sdf.sh"


def judged(judge: Path, *files: Path) -> str:
    done = subprocess.run(
        ["bash", str(judge), *map(str, files)], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


@pytest.mark.parametrize("simulator", ["classic", "gazebo"])
def test_libsdformat_takes_vehicles(judge: Path, tmp_path: Path, simulator: Any) -> None:
    path = tmp_path / "world.sdf"
    vehicles = place_vehicles(built(), ALL_KINDS, CAR)
    write_sdf(built(), path, simulator=simulator, vehicles=vehicles)
    assert "errors 0 worlds 1" in judged(judge, path)


@pytest.mark.real_data
def test_libsdformat_takes_the_sample(judge: Path, tmp_path: Path, data_dir: Path) -> None:
    files = []
    for name, world in sample_worlds(data_dir):
        files.append(tmp_path / f"{name}.sdf")
        write_sdf(world, files[-1], vehicles=place_vehicles(world, ALL_KINDS, CAR))
    assert judged(judge, *files).count("errors 0 worlds 1") == 60


def test_eight_hundred_buildings_are_checked_in_three_seconds(judge: Path, tmp_path: Path) -> None:
    house = shapely.from_wkt(
        "POLYGON ((0 0, 9 0, 9 4, 13 4, 13 9, 9 9, 9 14, 5 14, 5 11, 2 11, 2 7, 0 7, 0 0))"
    )
    corners = shapely.get_coordinates(house)[:-1]
    yard = np.array([[4.0, 5.0], [4.0, 7.0], [7.0, 7.0], [7.0, 5.0]])
    buildings = tuple(
        Building(
            id=f"w{i}",
            outline=corners + at,
            holes=(yard + at,) if i % 20 == 0 else (),
            height_m=Quantity(9.0, "default"),
        )
        for i in range(800)
        for at in [np.array([20.0 + 18.0 * (i % 40), 20.0 + 18.0 * (i // 40)])]
    )
    path = tmp_path / "town.sdf"
    world = msgspec.structs.replace(world_of(crossing()), buildings=buildings)
    write_sdf(world, path, vehicles=place_vehicles(world, ALL_KINDS, CAR))
    judged(judge, path)  # builds the strict judge where it is not there yet
    strict = Path(os.environ.get("TMPDIR", "/tmp")) / "sdf_strict"
    process = subprocess.Popen([str(strict), str(path)], stdout=subprocess.DEVNULL)
    _, status, used = os.wait4(process.pid, 0)
    process.returncode = os.waitstatus_to_exitcode(status)
    assert process.returncode == 0
    # Of the processor, since other processes may run: it works on one core and waits for nothing.
    assert used.ru_utime + used.ru_stime <= 3.0
    assert used.ru_maxrss / 1024**2 <= 0.8
