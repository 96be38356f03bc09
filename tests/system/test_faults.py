"""What dies or freezes in the middle of a live drive, and Ctrl-C."""

from __future__ import annotations

import os
import signal
import time
from pathlib import Path

import pyarrow.parquet as pq
import pytest
from mcap.reader import make_reader

from foretwin.orchestrator.commands.cli import run as command
from tests.starvation import kept_waiting
from tests.system.foretwin_command import (
    FRESH,
    Finished,
    child_pids,
    is_running,
    log_lines,
    rows_so_far,
    run_folder,
    started,
    wait_for,
)

ENDS_WITHIN_S = 240.0
LIVE = ("--futures", "12", "--least-futures", "12", "--rate", "2")


def says(run: Path, text: str) -> bool:
    return any(text in line["text"] for line in log_lines(run))


def said_by(run: Path, process_id: str, text: str) -> int:
    return sum(line["process"] == process_id and line["text"] == text for line in log_lines(run))


def when(run: Path, text: str) -> float:
    return next(line["wall_s"] for line in log_lines(run) if text in line["text"])


def under_way(out: Path) -> Path:
    """Wait until the car moves and a first world is loaded; return the drive's folder."""
    wait_for(lambda: run_folder(out) is not None, "the run's folder")
    run = run_folder(out)
    assert run is not None
    wait_for(lambda: says(run, "loaded by"), "the first world")
    wait_for(lambda: says(run, "on the map"), "the car on its way")
    return run


def assert_nothing_left(run: Path) -> None:
    left = {name: pid for name, pid in child_pids(run).items() if is_running(pid)}
    assert left == {}


def assert_readable(run: Path) -> None:
    with (run / "drive.mcap").open("rb") as file:
        assert sum(1 for _ in make_reader(file, validate_crcs=True).iter_messages()) > 0
    for table in (run / "results").glob("*.parquet"):
        pq.read_table(table)
    assert (run / "monitor.rrd").stat().st_size > 0


def test_who_is_killed_is_started_again_and_ctrl_c_ends_all(tmp_path: Path) -> None:
    out = tmp_path / "runs"
    arguments = (*LIVE, "--workers", "2", "--tuning", "report")
    with started(out, *arguments, entry=FRESH) as process:
        run = under_way(out)
        victim = child_pids(run)["w0"]
        with kept_waiting(process.pid) as kept:
            os.kill(victim, signal.SIGKILL)
            killed_s = time.time()
            wait_for(lambda: says(run, "w0 ended with code -9"), "the death being seen")
            wait_for(lambda: child_pids(run)["w0"] != victim, "the new worker")
        assert when(run, "w0 ended with code -9") - killed_s - kept.seconds < 1.0
        assert when(run, "started w0 again") - killed_s - kept.seconds < 2.0

        # A watcher is told of the parameters that count.
        assert command(["set", "vehicle.mass_kg=1300", "--out", str(out)]) == 0
        told = "parameters 1 count"
        wait_for(lambda: said_by(run, "tuning", told) == 1, "the watcher being told")
        os.kill(child_pids(run)["tuning"], signal.SIGKILL)
        wait_for(lambda: says(run, "tuning ended with code -9; started again"), "the death seen")
        wait_for(lambda: said_by(run, "tuning", told) == 2, "the new one being told")

        wait_for(lambda: rows_so_far(run, "futures") > 0, "the first futures")
        begun = time.monotonic()
        with kept_waiting(process.pid) as kept:
            process.send_signal(signal.SIGINT)
            screen, _ = process.communicate(timeout=ENDS_WITHIN_S)
        taken_s = time.monotonic() - begun
    assert process.returncode == 130, screen
    assert taken_s - kept.seconds < 3.0
    assert "Traceback" not in screen
    assert "warning: orchestrator: tuning ended with code -9; started again" in screen
    rows = pq.read_table(run / "results" / "futures.parquet").to_pylist()
    seen = [(row["round_id"], row["index"]) for row in rows]
    assert len(seen) == len(set(seen)) > 0, "no result counts twice"
    assert_readable(run)
    assert_nothing_left(run)


@pytest.mark.judge
def test_a_frozen_viewer_holds_nothing_up(tmp_path: Path) -> None:
    out = tmp_path / "runs"
    with started(out, *LIVE, "--end", "12") as process:
        run = under_way(out)
        os.kill(child_pids(run)["viewer"], signal.SIGSTOP)
        frozen_s = time.time()
        with kept_waiting(process.pid) as kept:
            screen, _ = process.communicate(timeout=ENDS_WITHIN_S)
    assert process.returncode == 0, screen
    rounds = pq.read_table(run / "results" / "rounds.parquet").to_pylist()
    started_s = when(run, "on the map")
    later = [row for row in rounds if row["drive_time_s"] > frozen_s - started_s + 1.0]
    # Half of the rounds that fall due in the time in which processes could run.
    could_run_s = 12.0 - (frozen_s - started_s) - 1.0 - kept.seconds
    assert len(later) >= max(1, min(5, int(0.5 * 2.0 * could_run_s)))
    assert_nothing_left(run)


@pytest.mark.parametrize("arguments", [(), ("--speed", "max")], ids=["live", "lock step"])
def test_a_killed_vehicle_ends_the_drive_with_what_there_is(
    tmp_path: Path, arguments: tuple[str, ...]
) -> None:
    out = tmp_path / "runs"
    with started(out, "--futures", "12", *arguments) as process:
        run = under_way(out)
        os.kill(child_pids(run)["vehicle"], signal.SIGKILL)
        screen, _ = process.communicate(timeout=240.0)
    left = Finished(process.returncode, screen, run)
    assert left.code == 3, screen
    ended = "vehicle ended with code -9: no telemetry comes any more, and the drive ends here"
    said_last = [line for line in screen.splitlines() if line.startswith(("error: ", "lost: "))]
    assert f"error: {ended}" in said_last
    assert "internal error" not in screen
    record = left.record()
    assert (record["exit"], record["troubles"]) == ("vehicle_ended", [ended])
    assert record["futures"]["rounds"] == len(left.rows("rounds"))
    assert not any(map(is_running, child_pids(run).values()))
