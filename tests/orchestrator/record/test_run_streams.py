"""Rows on their way to the disk: they wait while it takes none, and every lost one is counted."""

from __future__ import annotations

import errno
import os
from pathlib import Path
from typing import Any

import pytest

from foretwin.orchestrator.record import run_streams
from foretwin.orchestrator.record.run_streams import RunStreams
from tests.orchestrator.record.tables_for_streams import SCHEMA, read, rows


class Disk:
    """Takes what is written while it is `well`."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.well = True
        really = os.pwrite

        def pwrite(*what: Any) -> int:
            if not self.well:
                raise OSError(errno.ENOSPC, "No space left on device")
            return really(*what)

        monkeypatch.setattr(os, "pwrite", pwrite)


@pytest.fixture
def disk(monkeypatch: pytest.MonkeyPatch) -> Disk:
    return Disk(monkeypatch)


def test_what_a_full_disk_did_not_take_is_written_when_it_has_room(
    tmp_path: Path, disk: Disk
) -> None:
    streams = RunStreams(tmp_path, {"a": SCHEMA, "b": SCHEMA})
    streams.take("a", rows(0, 2))
    streams.write(sync=False)
    disk.well = False
    for number in (2, 3):
        streams.take("a", rows(number, 1))
        streams.take("b", rows(number, 1))
        streams.write(sync=True)
        assert streams.failing == "OSError: [Errno 28] No space left on device"
    assert read(tmp_path / "a.arrows") == rows(0, 2)
    disk.well = True
    streams.write(sync=True)
    streams.close()

    assert (streams.failing, streams.lost.total()) == (None, 0)
    assert read(tmp_path / "a.arrows") == rows(0, 4)
    assert read(tmp_path / "b.arrows") == rows(2, 2)


def test_a_disk_that_is_full_from_the_start_is_tried_again(tmp_path: Path, disk: Disk) -> None:
    disk.well = False
    streams = RunStreams(tmp_path, {"a": SCHEMA})
    streams.take("a", rows(0, 1))
    streams.write(sync=True)
    disk.well = True
    streams.write(sync=True)
    streams.close()

    assert read(tmp_path / "a.arrows") == rows(0, 1)


def test_so_much_waits_and_what_is_more_is_counted(
    tmp_path: Path, disk: Disk, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(run_streams, "WAITING_BYTES", 3000)
    streams = RunStreams(tmp_path, {"a": SCHEMA})
    disk.well = False
    for number in range(20):
        streams.take("a", rows(number, 1))
        streams.write(sync=False)
    disk.well = True
    streams.write(sync=False)
    streams.close()

    kept = len(read(tmp_path / "a.arrows"))
    assert 0 < kept < 20
    assert read(tmp_path / "a.arrows") == rows(0, kept)
    assert streams.lost.total() == 20 - kept


def test_what_still_waits_at_the_end_is_counted_with_its_reason(tmp_path: Path, disk: Disk) -> None:
    streams = RunStreams(tmp_path, {"a": SCHEMA})
    disk.well = False
    streams.take("a", rows(0, 3))
    streams.write(sync=False)
    streams.close()

    ((why, count),) = streams.lost.items()
    assert count == 3
    assert "No space left" in why


def test_a_row_that_does_not_fit_costs_itself_alone(tmp_path: Path) -> None:
    streams = RunStreams(tmp_path, {"a": SCHEMA})
    streams.take("a", [*rows(0, 2), {"number": "many"}, *rows(2, 1), {"number": 2**80}])
    streams.write(sync=False)
    streams.close()

    assert read(tmp_path / "a.arrows") == rows(0, 3)
    ((why, count),) = streams.lost.items()
    assert count == 2
    assert why.startswith("the table of a cannot hold them: ")


def test_rows_that_others_name_are_written_first(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """So that a kill in between leaves no future without its job."""
    streams = RunStreams(tmp_path, {"futures": SCHEMA, "jobs": SCHEMA})
    streams.write(sync=False)
    written: list[str] = []
    really = os.pwrite

    def pwrite(descriptor: int, *what: Any) -> int:
        written.append(Path(f"/proc/self/fd/{descriptor}").readlink().name)
        return really(descriptor, *what)

    monkeypatch.setattr(os, "pwrite", pwrite)
    for table in ("futures", "jobs"):
        streams.take(table, rows(0, 1))
    streams.write(sync=False)
    streams.close()

    assert written == ["jobs.arrows", "futures.arrows"]


def test_who_names_others_waits_for_them_on_a_disk_with_little_room(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A kill then leaves no round without its futures: it counts as one that is cut off."""
    streams = RunStreams(tmp_path, {"rounds": SCHEMA, "futures": SCHEMA, "a": SCHEMA})
    streams.write(sync=False)
    really, full = os.pwrite, True

    def pwrite(descriptor: int, *what: Any) -> int:
        name = Path(f"/proc/self/fd/{descriptor}").readlink().name
        if full and name == "futures.arrows":
            raise OSError(errno.ENOSPC, "No space left on device")
        return really(descriptor, *what)

    monkeypatch.setattr(os, "pwrite", pwrite)
    for table in ("rounds", "futures", "a"):
        streams.take(table, rows(0, 1))
    streams.write(sync=True)
    held = [read(tmp_path / f"{table}.arrows") for table in ("a", "futures", "rounds")]
    assert held == [rows(0, 1), [], []]
    full = False
    streams.write(sync=True)
    streams.close()
    assert read(tmp_path / "futures.arrows") == read(tmp_path / "rounds.arrows") == rows(0, 1)
