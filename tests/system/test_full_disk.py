"""A disk that takes no results: for a while it costs nothing, to the end it is said and counted."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.system.foretwin_command import Finished, log_lines, run_folder, started, wait_for

SMALL = ("--speed", "max", "--futures", "12", "--end", "8")
FULL_WHILE_THERE = """
import errno, os, sys
from pathlib import Path

pwrite = os.pwrite

def take(*what):
    if Path("full").exists() and "--setup" not in sys.argv:  # of results: no fork's file
        raise OSError(errno.ENOSPC, "No space left on device")
    return pwrite(*what)

os.pwrite = take
"""
"""Makes a drive's disk take no results as long as there is a file named `full`."""

pytestmark = pytest.mark.timeout(600)


def drive(folder: Path, *, to_the_end: bool) -> Finished:
    """Drive with a full disk, to the end or until the drive has told of it."""
    out, full = folder / "runs", folder / "full"
    full.touch()
    with started(out, *SMALL, changed_by=FULL_WHILE_THERE) as process:
        if not to_the_end:
            wait_for(lambda: run_folder(out) is not None, "the run's folder")
            run = run_folder(out)
            assert run is not None
            wait_for(lambda: says(run, "results cannot be written now, and wait"), "the trouble")
            full.unlink()
        screen, _ = process.communicate(timeout=240.0)
    return Finished(process.returncode, screen, run_folder(out))


def says(run: Path, text: str) -> bool:
    return any(text in line["text"] for line in log_lines(run))


@pytest.mark.judge
def test_a_disk_that_is_full_for_a_while_costs_nothing(tmp_path: Path) -> None:
    done = drive(tmp_path, to_the_end=False)
    assert done.code == 0, done.screen
    assert done.run is not None
    assert says(done.run, "results are written again")
    record = done.record()
    assert (record["troubles"], record["dropped"]["result_rows"]) == ([], 0)
    assert len(done.rows("rounds")) == record["futures"]["rounds"] > 0
    assert len(done.rows("futures")) == record["futures"]["count"]


def test_what_a_full_disk_cost_is_counted_and_said_last(tmp_path: Path) -> None:
    done = drive(tmp_path, to_the_end=True)
    assert done.code == 3, done.screen
    record = done.record()
    (trouble,) = record["troubles"]
    lost = record["dropped"]["result_rows"]
    assert record["exit"] == "completed"
    assert lost > record["futures"]["count"]
    assert trouble == (
        f"{lost} rows are lost: they could not be written: "
        "OSError: [Errno 28] No space left on device"
    )
    assert done.screen.splitlines()[-1] == f"error: {trouble}"
