"""ign-physics with DART builds our SDFormat worlds, and their twin stands and drives there.

It knows no polylines: what is solid beside the road, as buildings are, is nothing to it.
"""

from __future__ import annotations

import re
import subprocess
from pathlib import Path
from typing import NamedTuple

import pytest

from foretwin.contracts.world import World
from foretwin.world_gen.export.choices import VehicleKind
from foretwin.world_gen.export.sdformat import write_sdf
from foretwin.world_gen.export.sdformat_vehicles import place_vehicles
from tests.world_gen.drawn_maps import IRELAND, crossing, world_of
from tests.world_gen.export.judged_sample import sample_worlds
from tests.world_gen.export.test_sdformat import CAR

pytestmark = [pytest.mark.judge, pytest.mark.timeout(1800)]

LIBRARIES = ("ignition-physics5", "ignition-physics5-sdf", "ignition-plugin1-loader", "sdformat12")
SPEED_MPS, DRIVEN_S = 5.0, 5
VEHICLES: tuple[tuple[str, VehicleKind], ...] = (("twin", "twin"), ("ghost", "ghost"))


class Driven(NamedTuple):
    models: int
    rest_z_m: float
    moved_m: float
    end_z_m: float


@pytest.fixture(scope="module")
def driver(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    """Return the program that drives, built here, and DART's plugin, or skip where they are not."""
    try:
        flags = subprocess.run(
            ["pkg-config", "--cflags", "--libs", *LIBRARIES],
            capture_output=True,
            text=True,
            check=True,
        ).stdout.split()
    except (OSError, subprocess.CalledProcessError):
        pytest.skip("no ign-physics here (Debian: libignition-physics-dev and its DART plugin)")
    plugins = sorted(Path("/usr/lib").glob("*/libignition-physics5-dartsim-plugin.so"))
    if not plugins:
        pytest.skip("no DART for ign-physics here (Debian: libignition-physics5-dartsim-plugin5)")
    built = tmp_path_factory.mktemp("driver") / "drive_sdf"
    source = Path(__file__).with_name("drive_sdf.cc")
    subprocess.run(["g++", "-O1", "-std=c++17", source, "-o", built, *flags], check=True)
    return built, plugins[0]


def driven(driver: tuple[Path, Path], world: World, path: Path) -> Driven:
    write_sdf(world, path, simulator="gazebo", vehicles=place_vehicles(world, VEHICLES, CAR))
    radius = re.search(r"<wheel_radius>([\d.]+)<", path.read_text(encoding="utf-8"))
    assert radius
    words = [driver[0], driver[1], path, radius[1], str(SPEED_MPS), str(DRIVEN_S)]
    run = subprocess.run(words, capture_output=True, text=True, timeout=300, check=False)
    assert run.returncode == 0, run.stderr[-2000:]
    values = run.stdout.split()[-4:]
    return Driven(int(values[0]), *(float(value) for value in values[1:]))


def assert_drives(found: Driven) -> None:
    assert found.models > len(VEHICLES)
    assert abs(found.rest_z_m) < 0.05
    assert abs(found.end_z_m) < 0.05
    assert found.moved_m == pytest.approx(SPEED_MPS * DRIVEN_S, rel=0.1)


def test_a_drawn_world_drives_on_either_side(driver: tuple[Path, Path], tmp_path: Path) -> None:
    for name, world in (
        ("right", world_of(crossing())),
        ("left", world_of(crossing(origin=IRELAND))),
    ):
        assert_drives(driven(driver, world, tmp_path / f"{name}.sdf"))


@pytest.mark.real_data
def test_one_world_of_each_extract_drives(
    driver: tuple[Path, Path], tmp_path: Path, data_dir: Path
) -> None:
    seen = set()
    for name, world in sample_worlds(data_dir):
        extract = name.rpartition("-")[0]
        if extract not in seen:
            seen.add(extract)
            assert_drives(driven(driver, world, tmp_path / f"{name}.sdf"))
    assert len(seen) == 7
