"""What is wrong with what a drive left is noticed."""

from __future__ import annotations

import io
import json
import os
import re
import sys
import time
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from foretwin.orchestrator.record.table_stream import StreamReader
from foretwin.telemetry.logs.write_mcap import DriveWriter
from foretwin.telemetry.standin.source import START_STAMP_NS
from tests.chaos import losses, power_cut
from tests.chaos.faults import Fault, draw
from tests.chaos.injection import Done
from tests.chaos.invariants import wrong_with
from tests.chaos.left import Left
from tests.chaos.parts import recorded
from tests.chaos.run_processes import Member
from tests.orchestrator.record.ended_badly import killed_run
from tests.telemetry.own_recordings import read_drive

BALANCED = {
    "telemetry": {"published": 0, "recorded": 0, "lost": 0},
    "rounds": {"due": 3, "run": 1, "missed": 1, "spared": 1, "unseeded": 0, "given_up": 0},
    "jobs": {"given": 2, "results": 1, "refused": 1, "lost": 0},
}
BEGAN = json.dumps({"wall_s": 1000.0, "text": "the orchestrator is ready"}) + "\n"
DROVE_S, S = 4.0, 1_000_000_000


@pytest.fixture(autouse=True)
def short(monkeypatch: pytest.MonkeyPatch) -> None:
    """Drives here are short ones."""
    monkeypatch.setattr(losses, "END_S", DROVE_S)


def whole_run(folder: Path, **changed: Any) -> Path:
    """A run's folder after its end, as far as it is looked at."""
    results = folder / "results"
    results.mkdir(parents=True)
    rounds = pa.table({"round_id": [0, 1]})
    futures = pa.table({"round_id": [0, 0, 1], "index": [0, 1, 0]})
    pq.write_table(rounds, results / "rounds.parquet")
    pq.write_table(futures, results / "futures.parquet")
    pq.write_table(pa.table({"job_sha256": ["a", "b"]}), results / "jobs.parquet")
    (folder / "monitor.rrd").write_text("shown")
    record = {"exit": "completed", "troubles": [], "ledger": BALANCED} | changed
    (folder / "run.json").write_text(json.dumps(record))
    (folder / "log.jsonl").write_text(BEGAN)
    (folder / "drive.mcap").write_bytes(recorded(DROVE_S))
    return folder


def left(run: Path, *done: Done, code: int = 0, screen: str = "done") -> Left:
    syncs = run.parent / "syncs"
    case = draw(1, 0)._replace(source="standin")
    return Left(case, run, code, list(done), screen, (run.parent / "tmp",), syncs,
                run.parent, None, 0, {})  # fmt: skip


def befell(what: str, kind: str, after_s: float = 0.0) -> Done:
    """A fault so long after the car began, which was long ago."""
    began_ns = time.monotonic_ns() - time.time_ns() + 1000 * S
    return Done(Fault(1.0, what, kind), Member(kind, 1), began_ns + round(after_s * S))


def test_a_drive_that_ended_well_is_well(tmp_path: Path) -> None:
    assert wrong_with(left(whole_run(tmp_path / "run"))) == []


@pytest.mark.parametrize(
    ("done", "code", "exit_word", "well"),
    [
        ([("kill", "w")], 0, "completed", True), ([("kill", "w")], 130, "interrupted", False),
        ([("term", "orchestrator")], 130, "interrupted", True),
        ([("hup", "orchestrator")], 0, "completed", False),
        ([("kill", "vehicle")], 3, "vehicle_ended", True),
        ([("kill", "vehicle")], 1, "failed", False), ([("stop", "vehicle")], 1, "failed", False),
        ([("stop", "orchestrator")], 1, "failed", False), ([], 1, "completed", False),
        ([("memory", "orchestrator")], 2, "failed", False), ([], 0, "running", False),
    ],
)  # fmt: skip
def test_the_exit_code_fits_what_befell(
    tmp_path: Path, done: list[tuple[str, str]], code: int, exit_word: str, well: bool
) -> None:
    run = whole_run(tmp_path / "run", exit=exit_word)
    said = "error: why" if code == 3 else "done"
    found = wrong_with(left(run, *(befell(*one) for one in done), code=code, screen=said))
    assert (found == []) is well, found


@pytest.mark.parametrize("part", BALANCED)
def test_a_ledger_that_does_not_balance_is_noticed(tmp_path: Path, part: str) -> None:
    name = next(iter(BALANCED[part]))
    ledger = BALANCED | {part: BALANCED[part] | {name: 7}}
    (found,) = wrong_with(left(whole_run(tmp_path / "run", ledger=ledger)))
    assert f"the ledger of {part} does not balance" in found


def test_what_is_doubled_lost_untold_or_left_behind_is_noticed(tmp_path: Path) -> None:
    run = whole_run(tmp_path / "run", troubles=["rows are lost"])
    twice = pa.table({"round_id": [0, 0], "index": [1, 1]})
    pq.write_table(twice, run / "results" / "futures.parquet")
    (run / "results" / "rounds.parquet.writing").touch()
    (tmp_path / "tmp").mkdir()
    (tmp_path / "tmp" / "socket").touch()
    (tmp_path / "cache" / "foretwin").mkdir(parents=True)
    (tmp_path / "cache" / "foretwin" / "a.world.partial").touch()
    found = "\n".join(wrong_with(left(run)))
    for word in ("twice in futures", "rounds without futures: [1]", "something is lost",
                 "rounds.parquet.writing", "stays in tmp: ['socket']",
                 "in the cache: ['a.world.partial']"):  # fmt: skip
        assert word in found
    assert "does not say of what" in "\n".join(wrong_with(left(run, code=3)))
    assert "traceback" in "\n".join(wrong_with(left(run, screen="Traceback (most")))


def without(run: Path, *, from_s: float, to_s: float, channel: str = "imu") -> None:
    """Take samples out of a recording, up to the moment before `to_s`."""
    began_ns = START_STAMP_NS
    held = list(read_drive(run / "drive.mcap"))
    (run / "drive.mcap").unlink()
    with io.FileIO(run / "drive.mcap", "w") as raw, DriveWriter(raw) as writer:
        for name, message in held:
            at_s = (message.stamp_ns - began_ns) / S  # type: ignore[attr-defined]
            if name != channel or not from_s <= at_s < to_s:
                writer.add(name, message)


@pytest.mark.parametrize(
    ("from_s", "to_s", "killed", "found"),
    [
        (1.0, 1.9, [("recorder", 1.8)], ""),
        (1.0, 2.1, [("recorder", 2.0)], "1.10 s of telemetry are lost to one death"),
        (1.0, 2.1, [("w", 2.0)], "1 gaps are no death's"),
        (1.0, 1.02, [], "1 gaps are no death's"), (1.0, 1.0, [], ""),
        (3.5, 9.0, [], "1 gaps are no death's"),
        # Two deaths excuse no second and a half of one of them.
        (0.4, 1.9, [("recorder", 1.9), ("router", 3.9)], "1.50 s of telemetry are lost to one"),
    ],
)  # fmt: skip
def test_telemetry_that_is_lost_is_noticed(
    tmp_path: Path, from_s: float, to_s: float, killed: list[tuple[str, float]], found: str
) -> None:
    run = whole_run(tmp_path / "run")
    without(run, from_s=from_s, to_s=to_s)
    seen = left(run, *(befell("kill", kind, at_s) for kind, at_s in killed))
    wrong = wrong_with(seen)
    assert (len(wrong) == 1 and found in wrong[0]) if found else wrong == []
    if killed and killed[0][0] == "recorder":
        assert seen.lost_s[0] == pytest.approx(to_s - from_s, abs=0.011)


def test_what_a_full_disk_did_not_take_must_have_been_told(tmp_path: Path) -> None:
    lost = BALANCED | {"telemetry": {"published": 9, "recorded": 0, "lost": 9}}
    untold = whole_run(tmp_path / "untold")
    told = whole_run(tmp_path / "told", ledger=lost)
    full = Done(Fault(1.0, "full", "disk", 2.0), None, 0)
    for run in (untold, told):
        without(run, from_s=1.0, to_s=2.0)
    assert "no death's" in "".join(wrong_with(left(untold, full)))
    assert wrong_with(left(told, full, code=3, screen="lost: 9 samples")) == []


def test_samples_that_a_live_car_misses_are_noticed(tmp_path: Path) -> None:
    lost = BALANCED | {"telemetry": {"published": 700, "recorded": 0, "lost": 700}}
    run = whole_run(tmp_path / "run", ledger=lost)
    for deaths, well in ((0, False), (2, False), (3, True)):
        done = [befell("kill", "car", number) for number in range(deaths)]
        seen = left(run, *done, code=3, screen="lost: 700 samples")
        wrong = wrong_with(seen._replace(case=seen.case._replace(source="live")))
        assert (wrong == []) is well, wrong


def cut_run(tmp_path: Path) -> tuple[Path, Path]:
    """A run under way whose streams and recording are on the disk, and what told of it."""
    run, copies = killed_run(tmp_path / "run"), tmp_path / "disk" / "syncs"
    copies.mkdir(parents=True)
    with power_cut.log_of(copies).open("w") as log:
        for path in [run / "run.json", *power_cut.parts_of(run)]:
            known = path.stat()
            os.link(path, copies / str(known.st_ino))
            line = {"ns": 5, "path": str(path), "inode": known.st_ino, "bytes": known.st_size}
            log.write(json.dumps(line) + "\n")
    return run, copies


@pytest.mark.parametrize("seed", range(8))
def test_what_came_to_the_disk_is_there_after_a_power_cut(tmp_path: Path, seed: int) -> None:
    run, copies = cut_run(tmp_path)
    assert power_cut.wrong_after(run, copies, 9, tmp_path / "cut", str(seed)) == []
    assert pq.read_table(tmp_path / "cut" / "results" / "rounds.parquet").num_rows == 3


def test_rows_that_recovery_loses_are_noticed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    run, copies = cut_run(tmp_path)
    really = StreamReader.records
    count = power_cut.whole_of
    monkeypatch.setattr(power_cut, "whole_of", lambda path: count(path))
    monkeypatch.setattr(
        "foretwin.orchestrator.record.derive.StreamReader.records",
        lambda self: iter(list(really(self))[:-1]) if _from_recovery() else really(self),
    )
    found = power_cut.wrong_after(run, copies, 9, tmp_path / "cut", "0")
    assert any("rounds.arrows held 3" in one for one in found), found


def _from_recovery() -> bool:
    frame = sys._getframe()
    while frame is not None:
        if frame.f_code.co_name == "derive":
            return True
        frame = frame.f_back  # type: ignore[assignment]
    return False


def test_before_anything_came_to_the_disk_nothing_need_be_there(tmp_path: Path) -> None:
    run, copies = cut_run(tmp_path)
    syncs = power_cut.read_syncs(copies)
    assert power_cut.on_the_disk(syncs, run, 4) == {}
    assert len(power_cut.on_the_disk(syncs, run, 5)) == len(syncs) > 3
    assert power_cut.unsynced(syncs, run, 0, 10**9) == []
    assert len(power_cut.unsynced(syncs, run, 0, 4 * 10**9)) == 2


def test_a_sync_in_the_middle_of_a_record_is_noticed(tmp_path: Path) -> None:
    run, copies = cut_run(tmp_path)
    lines = [json.loads(line) for line in power_cut.log_of(copies).read_text().splitlines()]
    with power_cut.log_of(copies).open("w") as log:
        for line in lines:
            torn = line["bytes"] - (3 if "futures.arrows" in line["path"] else 0)
            log.write(json.dumps(line | {"bytes": torn}) + "\n")
    seeds = (str(number) for number in range(4))
    found = [power_cut.wrong_after(run, copies, 9, tmp_path / one, one) for one in seeds]
    told = re.findall(r"(\w+).arrows was synced up to (\d+), and is whole up to (\d+)", str(found))
    assert {name for name, _, _ in told} == {"futures"}, found
    assert all(int(whole) < int(size) for _, size, whole in told)
