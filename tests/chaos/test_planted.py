"""Whatever must hold of a drive can fail: it is broken on purpose, after a real one."""

from __future__ import annotations

import io
import json
import os
import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from foretwin.telemetry.logs.write_mcap import DriveWriter
from foretwin.telemetry.standin.source import START_STAMP_NS
from tests.chaos import drive
from tests.chaos.faults import Case, Fault
from tests.chaos.invariants import twice_in, wrong_with
from tests.chaos.left import Left
from tests.chaos.power_cut import read_syncs, wrong_after
from tests.chaos.run_processes import MARK, marked
from tests.telemetry.own_recordings import read_drive

pytestmark = [pytest.mark.chaos, pytest.mark.judge, pytest.mark.timeout(900)]

KILLED = Fault(12.0, "kill", "recorder")
CASE = Case(1, 0, "standin", "socket", False, (KILLED,))


def twice(table: str) -> Callable[[Path], None]:
    def plant(run: Path) -> None:
        file = run / "results" / f"{table}.parquet"
        rows = pq.read_table(file)
        pq.write_table(pa.concat_tables([rows, rows.slice(0, 1)]), file)

    return plant


def told(change: Callable[[dict[str, Any]], object]) -> Callable[[Path], None]:
    def plant(run: Path) -> None:
        record = json.loads((run / "run.json").read_text())
        change(record)
        (run / "run.json").write_text(json.dumps(record))

    return plant


def one_more(part: str, name: str) -> Callable[[Path], None]:
    def change(record: dict[str, Any]) -> None:
        record["ledger"][part][name] += 1

    return told(change)


def without(from_s: float, to_s: float) -> Callable[[Path], None]:
    """Take some of a channel's samples out of all parts of the recording."""

    def plant(run: Path) -> None:
        for part in run.glob("drive*.mcap"):
            held = list(read_drive(part))
            part.unlink()
            with io.FileIO(part, "w") as raw, DriveWriter(raw) as writer:
                for channel, message in held:
                    stamp_ns: int = message.stamp_ns  # type: ignore[attr-defined]
                    at_s = (stamp_ns - START_STAMP_NS) * 1e-9
                    if channel != "speed" or not from_s <= at_s < to_s:
                        writer.add(channel, message)

    return plant


PLANTS: dict[str, tuple[Callable[[Path], None], str]] = {
    "nothing": (lambda _: None, ""),
    "a future twice": (twice("futures"), "twice in futures"),
    "a round twice": (twice("rounds"), "twice in rounds"),
    "a job twice": (twice("jobs"), "twice in jobs"),
    "a round too many": (one_more("rounds", "run"), "the ledger of rounds does not balance"),
    "a job too few": (one_more("jobs", "given"), "the ledger of jobs does not balance"),
    "a sample nowhere": (
        one_more("telemetry", "published"), "the ledger of telemetry does not balance",
    ),
    "1.2 s lost to the kill": (without(11.0, 12.2), "are lost to one death"),
    "0.1 s lost to nobody": (without(20.0, 20.1), "gaps are no death's"),
    "the end lost": (without(24.9, 99.0), "gaps are no death's"),
    "a stream stays": (
        lambda run: (run / "results" / "rounds.arrows").touch(), "temporary files in the run's",
    ),
    "another end": (told(lambda one: one.update(exit="failed")), "and run.json says 'failed'"),
    "nothing shown": (lambda run: (run / "monitor.rrd").write_bytes(b""), "monitor.rrd is missing"),
}  # fmt: skip


def test_what_is_planted_in_a_real_drive_is_noticed(tmp_path: Path) -> None:
    found: dict[str, list[str]] = {}
    sleeper: list[subprocess.Popen[bytes]] = []

    def plant_all(left: Left) -> None:
        for name, (plant, _) in PLANTS.items():
            run = tmp_path / name.replace(" ", "-") / left.run.name
            shutil.copytree(left.run, run)
            plant(run)
            found[name] = wrong_with(left._replace(run=run, lost_s={}))
        found["another code"] = wrong_with(left._replace(code=130, lost_s={}))
        (left.temporary[0] / "left-behind").touch()
        environment = os.environ | {MARK: left.scratch.name}
        words = [sys.executable, "-c", "import time; time.sleep(600)"]
        sleeper.append(subprocess.Popen(words, env=environment))

    outcome = drive.carry_out(CASE, look_at=plant_all)
    try:
        assert [one.what for one in outcome.done] == ["kill"]
        for name, (_, words) in PLANTS.items():
            assert (words in "; ".join(found[name])) if words else found[name] == [], (name, found)
        assert "exit code 130" in "; ".join(found["another code"])
        wrong = "; ".join(outcome.wrong)
        assert "stays in tmp: ['left-behind']" in wrong
        assert f"still runs: {sleeper[0].pid}" in wrong
        assert len(outcome.wrong) == 2
        sleeper[0].wait(30.0)
    finally:
        shutil.rmtree(outcome.folder)


def test_a_drive_that_does_not_end_is_noticed_and_ended(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(drive, "ENDS_WITHIN_S", 0.5)
    outcome = drive.carry_out(CASE._replace(faults=()))
    assert "hangs: waited 0.5 s for the end of the drive" in outcome.wrong
    assert sum("still runs" in one for one in outcome.wrong) > 5
    assert marked(outcome.folder.name) == []
    shutil.rmtree(outcome.folder)


def test_up_to_each_sync_of_a_drive_all_is_readable(tmp_path: Path) -> None:
    """Its orchestrator and its recorder were killed in between: others went on with their files."""
    wrong: list[str] = []
    cuts: set[int] = set()

    def cut_everywhere(left: Left) -> None:
        cuts.update(one.ns for one in read_syncs(left.syncs) if left.run in one.path.parents)
        for cut_ns in sorted(cuts):
            target = tmp_path / "cut"
            wrong.extend(wrong_after(left.run, left.syncs, cut_ns, target, str(cut_ns)))
            wrong.extend(twice_in(target / "results"))
            shutil.rmtree(target)

    kills = (Fault(5.0, "kill", "orchestrator"), KILLED, Fault(15.0, "segv", "orchestrator"))
    outcome = drive.carry_out(CASE._replace(faults=kills), look_at=cut_everywhere)
    assert outcome.wrong == []
    assert [one.kind for one in outcome.done] == ["orchestrator", "recorder", "orchestrator"]
    assert len(cuts) > 100
    assert wrong == []
