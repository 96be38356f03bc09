"""Damaged logs of every kind: read as far as they go, or refused in one line; never a traceback."""

from __future__ import annotations

import itertools
import random
import shutil
from pathlib import Path

import pytest

from foretwin.telemetry.logs import open_log, read_line
from foretwin.telemetry.logs.opening import open_road_users
from tests.damaged_files import read_damaged
from tests.telemetry.whole_logs import whole_logs

FEW, MANY, MANY_REAL = 400, 14_000, 700


def samples_of(path: Path) -> None:
    for _ in itertools.islice(open_log(path).samples(), 5000):
        pass


def road_users_of(path: Path) -> None:
    open_road_users(path)


def line_of(path: Path) -> None:
    read_line(path)


READERS = (samples_of, road_users_of, line_of)


@pytest.fixture(scope="module")
def originals(tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    return whole_logs(tmp_path_factory.mktemp("whole"))


def test_the_whole_logs_are_read(originals: list[Path]) -> None:
    names = {path.name for path in originals}
    for path in originals:
        if path.name == "way.gpx":
            line_of(path)
        elif path.name == "mcity.json":
            road_users_of(path)
        else:
            samples_of(path)
    assert len(names) == 19


def test_a_damaged_log_is_read_or_refused(originals: list[Path], tmp_path: Path) -> None:
    assert read_damaged(originals, READERS, folder=tmp_path, count=FEW, seed=1) == []


@pytest.mark.judge
@pytest.mark.timeout(3600)
def test_many_damaged_logs_are_read_or_refused(originals: list[Path], tmp_path: Path) -> None:
    seed = random.SystemRandom().randrange(2**32)
    print(f"seed {seed}")
    found = read_damaged(originals, READERS, folder=tmp_path, count=MANY, seed=seed)

    assert found == [], f"seed {seed}"


REAL = (
    "drive-berlin-gendarmenmarkt/Berlin_Gendarmenmarkt_GT.txt",
    "drives-hannover/2021_GoogleMaps.geojson",
    "drive-comma2k19-sf/segment40",
)
REAL_BYTES = 200_000


@pytest.mark.judge
@pytest.mark.real_data
@pytest.mark.timeout(3600)
def test_damaged_logs_of_real_drives_are_read_or_refused(data_dir: Path, tmp_path: Path) -> None:
    originals = []
    for name in REAL:
        copy = tmp_path / "whole" / Path(name).name
        copy.parent.mkdir(exist_ok=True)
        if (data_dir / name).is_dir():
            shutil.copytree(data_dir / name, copy)
        else:
            copy.write_bytes((data_dir / name).read_bytes()[:REAL_BYTES])
        originals.append(copy)
    seed = random.SystemRandom().randrange(2**32)
    print(f"seed {seed}")
    found = read_damaged(originals, READERS, folder=tmp_path, count=MANY_REAL, seed=seed)

    assert found == [], f"seed {seed}"
