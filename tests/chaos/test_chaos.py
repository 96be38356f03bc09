"""The chaos that drives are put through: drawn from a seed, and what is wrong is noticed."""

from __future__ import annotations

import json
import os
import random
import shutil
import subprocess
import sys
from collections import Counter
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from foretwin.orchestrator.record.table_stream import StreamReader
from tests.chaos import __main__ as chaos
from tests.chaos import power_cut
from tests.chaos.disk import small_disk
from tests.chaos.faults import WEIGHTS, Fault, draw
from tests.chaos.injection import Done
from tests.chaos.invariants import Left, wrong_with
from tests.chaos.run_processes import MARK, Member, end_all, marked, members
from tests.orchestrator.record.ended_badly import killed_run
from tests.system.foretwin_command import is_running, wait_for

SEED = int(os.environ.get("FORETWIN_CHAOS_SEED", "0")) or random.SystemRandom().randrange(1, 10**6)
BALANCED = {
    "telemetry": {"published": 0, "recorded": 0, "lost": 0},
    "rounds": {"due": 3, "run": 1, "missed": 1, "spared": 1, "unseeded": 0, "given_up": 0},
    "jobs": {"given": 2, "results": 1, "refused": 1, "lost": 0},
}


@pytest.mark.chaos
@pytest.mark.judge
@pytest.mark.timeout(3600)
def test_whatever_befalls_drives_they_end_well(capsys: pytest.CaptureFixture[str]) -> None:
    with capsys.disabled():
        assert chaos.run(SEED, count=60), f"FORETWIN_CHAOS_SEED={SEED} draws the same again"


def test_a_seed_draws_the_same_drives_and_all_faults_come() -> None:
    cases = [draw(7, number) for number in range(120)]
    assert cases == [draw(7, number) for number in range(120)]
    drawn = Counter(one.what for case in cases for one in case.faults)
    assert drawn.keys() == WEIGHTS.keys()
    assert 700 < drawn.total() < 1200
    for case in cases:
        times = [one.at_s for one in case.faults]
        assert times == sorted(times)
        assert sum(one.target in ("command", "vehicle") for one in case.faults[:-1]) <= 4


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
    return folder


def left(run: Path, *done: Done, code: int = 0, screen: str = "done") -> Left:
    syncs = run.parent / "syncs"
    return Left(draw(1, 0), run, code, list(done), screen, (run.parent / "tmp",), syncs,
                run.parent, None, 0)  # fmt: skip


def befell(what: str, kind: str) -> Done:
    return Done(Fault(1.0, what, kind), Member(kind, 1), 0)


def test_a_drive_that_ended_well_is_well(tmp_path: Path) -> None:
    assert wrong_with(left(whole_run(tmp_path / "run"))) == []


@pytest.mark.parametrize(
    ("done", "code", "exit_word", "well"),
    [
        ([("kill", "w")], 0, "completed", True), ([("kill", "w")], 130, "interrupted", False),
        ([("term", "orchestrator")], 130, "interrupted", True),
        ([("hup", "orchestrator")], 0, "completed", False),
        ([("kill", "vehicle")], 1, "failed", True), ([("stop", "vehicle")], 1, "failed", False),
        ([("stop", "orchestrator")], 1, "failed", False), ([], 1, "completed", False),
        ([("memory", "orchestrator")], 2, "failed", False), ([], 0, "running", False),
    ],
)  # fmt: skip
def test_the_exit_code_fits_what_befell(
    tmp_path: Path, done: list[tuple[str, str]], code: int, exit_word: str, well: bool
) -> None:
    run = whole_run(tmp_path / "run", exit=exit_word)
    found = wrong_with(left(run, *(befell(*one) for one in done), code=code))
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
    found = "\n".join(wrong_with(left(run)))
    for word in ("twice in futures", "rounds without futures: [1]", "something is lost",
                 "rounds.parquet.writing", "stays in tmp: ['socket']"):  # fmt: skip
        assert word in found
    assert "does not say of what" in "\n".join(wrong_with(left(run, code=3)))
    assert "traceback" in "\n".join(wrong_with(left(run, screen="Traceback (most")))


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


def test_processes_of_a_drive_are_found_by_what_it_tells(tmp_path: Path) -> None:
    mark, folder = f"chaos-test-{os.getpid()}", tmp_path / "run" / "processes"
    folder.mkdir(parents=True)
    sleep = [sys.executable, "-c", "import time; time.sleep(600)"]
    environment = os.environ | {MARK: mark}
    with (
        subprocess.Popen([*sleep, "--setup", str(folder / "w1.json")], env=environment) as worker,
        subprocess.Popen(sleep, env=environment) as command,
        subprocess.Popen(sleep, env=environment) as fork,
    ):
        said = f'{{"text": "forked the orchestrator as process {fork.pid}"}}\n'
        (folder.parent / "log.jsonl").write_text(said)
        try:
            wait_for(lambda: len(marked(mark)) == 3, "all of them")
            found = members(folder.parent, mark, command.pid)
            assert found == [
                ("command", command.pid), ("orchestrator", fork.pid), ("w1", worker.pid),
            ]  # fmt: skip
            assert [one.kind for one in found] == ["command", "orchestrator", "w"]
        finally:
            assert len(end_all(mark)) == 3
        wait_for(lambda: not is_running(worker.pid), "its end")
    assert marked(mark) == []


@pytest.mark.skipif(os.geteuid() != 0 or shutil.which("mount") is None, reason="may mount nothing")
def test_a_small_disk_is_full_when_it_is_told_to_be(tmp_path: Path) -> None:
    with small_disk(tmp_path / "disk") as disk:
        if not disk.limited:
            pytest.skip("no disk of its own here")
        (disk.folder / "inside").mkdir()
        assert disk.fill()
        with pytest.raises(OSError, match="No space"):
            (disk.folder / "file").write_bytes(bytes(10_000))
        disk.free()
        if disk.close_folders(disk.folder / "inside"):
            with pytest.raises(PermissionError):
                (disk.folder / "inside" / "file").touch()
            disk.open_folders()
        (disk.folder / "inside" / "file").write_bytes(bytes(10_000))
    assert list((tmp_path / "disk").iterdir()) == []
