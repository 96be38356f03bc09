"""Where nothing can be written: one line that names the place, exit code 2, nothing half-made."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from foretwin.orchestrator.commands.cli import run as command
from foretwin.orchestrator.embedded import MAP_FILE
from tests.chaos.disk import SmallDisk, small_disk
from tests.orchestrator.record.ended_badly import killed_run, record
from tests.orchestrator.sweeps import small_sweep

DRIVE = "drive --source standin --view none --end 2 --futures 4 --workers 1 --tuning off --out"
WRITES = {
    "drive": f"{DRIVE} {{place}}/runs",
    "sweep": "sweep {here}/small.toml --workers 1 --out {place}/swept",
    "world": f"world {MAP_FILE} --at 0,0 --out {{place}}/one.world",
    "convert": "convert {here}/drive.mcap {place}/drive.csv",
    "gap": "gap {here}/drive.mcap --out {place}/plots",
}


@pytest.fixture
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    small_sweep(tmp_path)
    record(tmp_path / "drive.mcap", 20)
    return tmp_path


@pytest.fixture
def disk(tmp_path: Path) -> Iterator[SmallDisk]:
    with small_disk(tmp_path / "disk") as disk:
        if not disk.limited:
            pytest.skip("a disk of its own takes root")
        yield disk


def asked(name: str, here: Path, place: Path) -> list[str]:
    return [word.format(here=here, place=place) for word in WRITES[name].split()]


def said_in_a_line(capsys: pytest.CaptureFixture[str]) -> str:
    told = capsys.readouterr().err.strip().splitlines()
    line = told[-1]
    assert line.startswith("foretwin: ")
    assert not any("Traceback" in one for one in told)
    return line


@pytest.mark.parametrize("name", WRITES)
def test_a_folder_of_the_system_is_named(
    name: str, here: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert command(asked(name, here, Path("/proc"))) == 2
    line = said_in_a_line(capsys)
    assert "/proc" in line
    assert name == "convert" or "--out /proc/" in line or "--at" in line


@pytest.mark.parametrize("name", ["drive", "sweep", "convert"])
def test_a_full_disk_is_named_and_keeps_nothing(
    name: str, here: Path, disk: SmallDisk, capsys: pytest.CaptureFixture[str]
) -> None:
    assert disk.fill()
    there = set(disk.folder.rglob("*"))
    code = command(asked(name, here, disk.folder))
    line = said_in_a_line(capsys)
    assert code == 2, line
    assert str(disk.folder) in line
    assert "no space left on device" in line
    assert set(disk.folder.rglob("*")) == there


def test_the_cache_is_named_where_it_takes_nothing(
    here: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", "/proc/cache")
    assert command(asked("drive", here, here)) == 2
    line = said_in_a_line(capsys)
    assert line == (
        "foretwin: the cache /proc/cache/foretwin/worlds: folder /proc cannot be written to"
    )
    assert not (here / "runs").exists()


def test_a_killed_run_on_a_full_disk_stays_as_it_is(
    disk: SmallDisk, capsys: pytest.CaptureFixture[str]
) -> None:
    run = killed_run(disk.folder / "run")
    disk.fill()
    there = {path: path.read_bytes() for path in run.rglob("*.arrows")}
    assert command(["recover", str(run)]) == 2
    assert f"{run}: cannot be recovered: " in said_in_a_line(capsys)
    assert {path: path.read_bytes() for path in run.rglob("*.arrows")} == there
    disk.free()
    assert command(["recover", str(run)]) == 0
