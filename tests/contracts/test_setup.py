"""What processes are started with, as files."""

from __future__ import annotations

import errno
from pathlib import Path

import msgspec
import pytest

from foretwin.contracts.frames import GeoPoint, LocalFrame
from foretwin.contracts.setup import (
    BuilderSetup,
    BusSetup,
    ProcessSetup,
    RecorderSetup,
    ReplaySetup,
    ViewerSetup,
    read_setup,
    write_setup,
)

BUS = BusSetup(endpoint="tcp/127.0.0.1:7447", lossless=True)
COMMON = {"run_id": "r", "process_id": "p", "vehicle_id": "v", "bus": BUS, "log_file": "p.jsonl"}
SETUPS = (
    ReplaySetup(**COMMON, log="drive.gpx", start_s=1.5, speed=None),
    RecorderSetup(**COMMON, file="drive.mcap"),
    BuilderSetup(
        **COMMON, map="town.osm", near_deg=((52.5, 13.4),), worlds_dir="worlds", cache_dir="cache"
    ),
    ViewerSetup(
        **COMMON, file="a.rrd", worlds_dir="worlds", drive_frame=LocalFrame(GeoPoint(52.5, 13.4))
    ),
)


@pytest.mark.parametrize("setup", SETUPS, ids=lambda setup: type(setup).__name__)
def test_a_setup_is_read_as_it_was_written(setup: ProcessSetup, tmp_path: Path) -> None:
    write_setup(setup, tmp_path / "setup.json")
    assert read_setup(tmp_path / "setup.json", type(setup)) == setup


def test_a_setup_of_another_process_is_refused_by_the_field(tmp_path: Path) -> None:
    write_setup(SETUPS[0], tmp_path / "setup.json")
    with pytest.raises(msgspec.ValidationError, match="unknown field `log`"):
        read_setup(tmp_path / "setup.json", RecorderSetup)


def test_a_setup_that_is_there_needs_no_room_on_a_full_disk(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(*_: object) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    write_setup(SETUPS[0], tmp_path / "setup.json")
    monkeypatch.setattr(Path, "write_bytes", full)
    write_setup(SETUPS[0], tmp_path / "setup.json")
    assert read_setup(tmp_path / "setup.json", ReplaySetup) == SETUPS[0]
    with pytest.raises(OSError, match="No space"):
        write_setup(SETUPS[1], tmp_path / "setup.json")
