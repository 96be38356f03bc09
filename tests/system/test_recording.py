"""What becomes of the recording where recorder, viewer or disk fail in the middle of a drive."""

from __future__ import annotations

import contextlib
import json
import os
import resource
import signal
import time
from collections import Counter
from pathlib import Path
from typing import Any

import pytest
from mcap.exceptions import McapError
from mcap.records import Channel, Message
from mcap.stream_reader import StreamReader

from foretwin.contracts.segments import segments_of
from foretwin.telemetry.logs import open_log
from foretwin.telemetry.ros_messages.table import kind_of
from tests.system.foretwin_command import child_pids, started, wait_for
from tests.system.test_faults import (
    ENDS_WITHIN_S,
    LIVE,
    assert_nothing_left,
    says,
    under_way,
)
from tests.viewer.readback import Recorded


def recorded_for_a_while(out: Path) -> Path:
    """Wait until a part of a drive is on the disk; return the drive's folder."""
    run = under_way(out)
    wait_for(lambda: (run / "drive.mcap").stat().st_size > 30_000, "a part of the drive")
    return run


def record_of(run: Path) -> dict[str, Any]:
    return json.loads((run / "run.json").read_text(encoding="utf-8"))


def numbers_in(run: Path) -> Counter[tuple[str, int]]:
    """Count the messages in all parts by topic and their sender's number, up to where one ends."""
    found: Counter[tuple[str, int]] = Counter()
    for part in segments_of(run / "drive.mcap"):
        topics: dict[int, str] = {}
        with part.open("rb") as file, contextlib.suppress(McapError):
            for item in StreamReader(file, validate_crcs=True).records:
                if isinstance(item, Channel):
                    topics[item.id] = item.topic
                elif isinstance(item, Message) and counts(topics[item.channel_id]):
                    found[topics[item.channel_id], item.sequence] += 1
    return found


def counts(topic: str) -> bool:
    """Whether a topic holds the vehicle's samples, each once."""
    return kind_of(topic) is not None and topic not in ("/foretwin/end", "/foretwin/state_json")


def assert_all_is_recorded(run: Path, *, parts: int) -> None:
    """Everything that the vehicle sent lies in the files, each once, and reads as one drive."""
    ledger = record_of(run)["ledger"]["telemetry"]
    assert (ledger["published"], ledger["lost"]) == (ledger["recorded"], 0), ledger
    numbers = numbers_in(run)
    assert numbers.total() == len(numbers) == ledger["recorded"]
    assert len(segments_of(run / "drive.mcap")) == parts
    log = open_log(run / "drive.mcap")
    assert sum(1 for _ in log.samples()) == ledger["recorded"]
    assert log.skipped.total() <= 1  # the part that was cut short


def test_a_killed_recorder_comes_back_and_nothing_is_lost(tmp_path: Path) -> None:
    out = tmp_path / "runs"
    with started(out, *LIVE, "--end", "9") as process:
        run = recorded_for_a_while(out)
        victim = child_pids(run)["recorder"]
        os.kill(victim, signal.SIGKILL)
        wait_for(lambda: says(run, "recorder ended with code -9; started again"), "the death seen")
        screen, _ = process.communicate(timeout=ENDS_WITHIN_S)
    assert process.returncode == 0, screen
    assert_all_is_recorded(run, parts=2)
    assert_nothing_left(run)


@pytest.mark.judge
def test_a_recorder_that_is_away_at_the_end_is_waited_for(tmp_path: Path) -> None:
    """Who sent keeps it, and leaves with the run."""
    out = tmp_path / "runs"
    with started(out, *LIVE, "--end", "12") as process:
        run = recorded_for_a_while(out)
        while not says(run, "the drive is over"):
            with contextlib.suppress(ProcessLookupError):
                os.kill(child_pids(run)["recorder"], signal.SIGKILL)
            time.sleep(0.05)
        screen, _ = process.communicate(timeout=ENDS_WITHIN_S)
    assert process.returncode == 0, screen
    assert says(run, "the drive ends once recorder is there again")
    assert_all_is_recorded(run, parts=2)
    assert_nothing_left(run)


@pytest.mark.judge
def test_a_disk_that_is_full_for_a_while_costs_nothing(tmp_path: Path) -> None:
    out = tmp_path / "runs"
    with started(out, *LIVE, "--end", "14") as process:
        run = recorded_for_a_while(out)
        recorder = child_pids(run)["recorder"]
        room = resource.prlimit(recorder, resource.RLIMIT_FSIZE)
        resource.prlimit(recorder, resource.RLIMIT_FSIZE, (0, room[1]))
        wait_for(lambda: says(run, "drive.mcap cannot be written: File too large"), "a full disk")
        resource.prlimit(recorder, resource.RLIMIT_FSIZE, room)
        wait_for(lambda: says(run, "drive-002.mcap: the recording goes on"), "room again")
        screen, _ = process.communicate(timeout=ENDS_WITHIN_S)
    assert process.returncode == 0, screen
    assert screen.count("cannot be written") == 1
    assert_all_is_recorded(run, parts=2)


@pytest.mark.judge
def test_what_a_full_disk_cost_is_counted_and_said_last(tmp_path: Path) -> None:
    out = tmp_path / "runs"
    with started(out, *LIVE, "--end", "9") as process:
        run = recorded_for_a_while(out)
        recorder = child_pids(run)["recorder"]
        resource.prlimit(recorder, resource.RLIMIT_FSIZE, (0, resource.RLIM_INFINITY))
        screen, _ = process.communicate(timeout=ENDS_WITHIN_S)
    assert process.returncode == 3, screen
    ledger = record_of(run)["ledger"]["telemetry"]
    assert ledger["published"] == ledger["recorded"] + ledger["lost"]
    assert ledger["recorded"] == numbers_in(run).total()
    assert ledger["lost"] > 0
    last = screen.splitlines()[-1]
    assert last.startswith(f"lost: {ledger['lost']} of {ledger['published']} telemetry samples")


@pytest.mark.judge  # chaos kills it too
def test_a_killed_viewer_shows_the_rest_in_a_file_of_its_own(tmp_path: Path) -> None:
    out = tmp_path / "runs"
    with started(out, *LIVE, "--end", "14") as process:
        run = recorded_for_a_while(out)
        os.kill(child_pids(run)["viewer"], signal.SIGKILL)
        wait_for(lambda: (run / "monitor-002.rrd").exists(), "the new viewer")
        screen, _ = process.communicate(timeout=ENDS_WITHIN_S)
    assert process.returncode == 3, screen
    assert "viewer ended with code -9" in screen.splitlines()[-1]
    assert (run / "monitor.rrd").stat().st_size > 0
    shown = Recorded(run / "monitor-002.rrd")
    assert len(shown.times_s("/world/ego/real")) > 0
    assert any(path.startswith("/world/map/") for path in shown.paths), "the World in force"
    assert_nothing_left(run)
