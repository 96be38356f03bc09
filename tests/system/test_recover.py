"""The orchestrator killed at any instant: what it had until a second before is there afterwards."""

from __future__ import annotations

import os
import random
import signal
import time
from collections import defaultdict
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import pyarrow as pa
import pytest
from mcap.reader import make_reader

import foretwin
from foretwin.contracts.bus import Mailbox, Received, ZenohBus
from foretwin.contracts.errors import UserError
from foretwin.contracts.joining import running_drive
from foretwin.orchestrator.commands.cli import run as command
from foretwin.orchestrator.record.results import TABLES
from tests.starvation import kept_waiting
from tests.system.foretwin_command import (
    child_pids,
    is_running,
    orchestrator_pid,
    run_folder,
    started,
    wait_for,
)

SEED = int(os.environ.get("FORETWIN_KILL_SEED", "0")) or random.SystemRandom().randrange(1, 10**6)
"""Printed, so that a failure can be had again: FORETWIN_KILL_SEED=…"""
LIVE = ("--futures", "12", "--least-futures", "12")
LOCK_STEP = ("--futures", "12", "--speed", "max")
WITHIN_S = 1.0
"""What was told so long before the kill must be there."""
LEAVE_WITHIN_S = 8.0
"""The other processes: their grace of 5 s, and what they then still write."""
HEARD = {"round": "rounds", "comparison": "comparisons", "mirror": "mirror"}
"""What a drive tells on the bus, and the table where each message has a row of its stamp."""

pytestmark = pytest.mark.timeout(600)


class Killed(NamedTuple):
    """A killed drive's folder, and stamps by table that were told a second before the kill."""

    run: Path
    told_ns: dict[str, set[int]]


def killed(out: Path, arguments: tuple[str, ...], after_s: float) -> Killed:
    """Kill a drive so long after it told of its first round."""
    with started(out, *arguments) as process:
        wait_for(partial(there, out, "*/run.json"), "the run's record")
        run = run_folder(out)
        assert run is not None
        messages = Mailbox(100_000)
        with ZenohBus(running_drive(run).bus("viewer")) as bus:
            for channel in HEARD:
                bus.subscribe(channel, messages, run=run.name)
            wait_for(lambda: len(messages) > 0, "the first round")
            kill_s = time.monotonic() + after_s
            wait_for(lambda: time.monotonic() > kill_s - 2 * WITHIN_S, "a random instant")
            with kept_waiting(process.pid) as kept:
                wait_for(lambda: time.monotonic() > kill_s, "a random instant")
            # The supervisor first: it would start another orchestrator.
            orchestrator = orchestrator_pid(run)
            process.kill()
            os.kill(orchestrator, signal.SIGKILL)
            kill_s = time.monotonic()
            process.wait()
        pids = child_pids(run)
        assert len(pids) >= 6
        with kept_waiting(*pids.values()) as kept_leaving:
            taken_s = wait_for(lambda: not any(map(is_running, pids.values())), "the end of all")
        assert taken_s < LEAVE_WITHIN_S + kept_leaving.seconds
    told_ns: dict[str, set[int]] = defaultdict(set)
    while (item := messages.take()) is not None:
        assert isinstance(item, Received)
        if item.received_mono_ns / 1e9 < kill_s - WITHIN_S - kept.seconds:
            told_ns[HEARD[item.channel]].add(item.message().stamp_ns)
    return Killed(run, told_ns)


def assert_goes_together(tables: dict[str, pa.Table]) -> None:
    """Assert that every round has its futures, and every future its job."""
    jobs = set(tables["jobs"]["job_sha256"].to_pylist())
    futures = defaultdict(set)
    for row in tables["futures"].select(["round_id", "index", "job_sha256"]).to_pylist():
        assert row["job_sha256"] in jobs
        futures[row["round_id"]].add(row["index"])
    for row in tables["rounds"].to_pylist():
        assert len(futures[row["round_id"]]) == row["futures"]


def assert_ledger_fits(record: dict[str, Any], tables: dict[str, pa.Table]) -> None:
    """Assert that what is known balances, and that what is not is named."""
    ledger, unknown = record["ledger"], set(record["recovered"]["unknown"])
    telemetry = ledger["telemetry"]
    assert telemetry["published"] == telemetry["recorded"] + telemetry["lost"]
    if record["recovered"]["told_until_s"] is None:  # killed before it had said anything
        assert ledger["rounds"] is None
        assert {"ledger.rounds", "ledger.jobs", "tuning", "telemetry"} < unknown
        return
    assert unknown == set()
    for name, whole in (("rounds", "due"), ("jobs", "given")):
        counts = ledger[name]
        assert counts[whole] == sum(n for of, n in counts.items() if of != whole), name
    assert ledger["rounds"]["run"] == tables["rounds"].num_rows
    assert ledger["jobs"]["results"] >= tables["jobs"].num_rows
    windows = 0 if record["agreement"] is None else record["agreement"]["windows"]
    assert windows == tables["windows"].num_rows == tables["agreement"].num_rows
    assert record["telemetry"]["received"] > 0


def contents(run: Path) -> dict[Path, bytes]:
    return {path: path.read_bytes() for path in run.rglob("*") if path.is_file()}


def test_a_drive_killed_before_it_wrote_a_row_has_its_tables(tmp_path: Path) -> None:
    run, _ = killed(tmp_path / "runs", LOCK_STEP, after_s=0.0)

    assert command(["recover", str(run)]) == 0
    recording = foretwin.open_run(run)
    assert all(recording.table(name).schema.equals(columns) for name, columns in TABLES.items())


@pytest.mark.parametrize("arguments", [LIVE, LOCK_STEP], ids=["live", "lock step"])
def test_what_was_told_a_second_before_a_kill_is_recovered(
    tmp_path: Path, arguments: tuple[str, ...], capsys: pytest.CaptureFixture[str]
) -> None:
    after_s = random.Random(f"{SEED} {arguments}").uniform(0.0, 5.0)
    print(f"FORETWIN_KILL_SEED={SEED}: killed {after_s:.3f} s after the first round")
    run, told_ns = killed(tmp_path / "runs", arguments, after_s)
    with pytest.raises(UserError, match=f"foretwin recover {run}"):
        foretwin.open_run(run)
    for asked in (["repeat", str(run), "any"], ["judge", str(run)], ["gap", f"{run}/drive.mcap"]):
        assert command(asked) == 2
        assert f"`foretwin recover {run}`" in capsys.readouterr().err

    code = command(["recover", str(run)])
    said = capsys.readouterr().out
    assert code == (3 if "lost in part" in said else 0), said
    recording = foretwin.open_run(run)
    tables = {name: recording.table(name) for name in TABLES}
    for table, stamps_ns in told_ns.items():
        assert stamps_ns <= set(tables[table]["stamp_ns"].to_pylist()), table
    assert_goes_together(tables)
    assert recording.record["exit"] == "recovered"
    # Futures are written before their round: the kill may have come in between.
    whole = set(tables["rounds"]["round_id"].to_pylist())
    of_whole = [one for one in tables["futures"]["round_id"].to_pylist() if one in whole]
    assert recording.record["futures"]["count"] == len(of_whole)
    assert f"\nrounds: {tables['rounds'].num_rows} rows" in said
    assert_ledger_fits(recording.record, tables)
    assert {path.suffix for path in (run / "results").iterdir()} == {".parquet"}
    assert not list(run.rglob("*.stderr"))
    with (run / "drive.mcap").open("rb") as file:
        assert sum(1 for _ in make_reader(file, validate_crcs=True).iter_messages()) > 0

    before = contents(run)
    assert command(["recover", str(run)]) == 0
    assert "nothing to recover" in capsys.readouterr().out
    assert contents(run) == before
    if tables["futures"].num_rows:
        assert command(["repeat", str(run), tables["futures"]["future_id"][0].as_py()]) == 0


ON_A_TERMINAL = """
import os, pty, select, signal, sys
process, terminal = pty.fork()
if not process:
    os.execv(sys.executable, [sys.executable, "-P", "-m", "foretwin", *sys.argv[1:]])
asked = []
signal.signal(signal.SIGHUP, lambda number, _: asked.append(number))
while not asked:
    if select.select([terminal], [], [], 0.1)[0]:
        os.read(terminal, 65536)
os.close(terminal)
sys.exit(os.waitstatus_to_exitcode(os.waitpid(process, 0)[1]))
"""
"""A terminal with a drive on it; SIGHUP closes it."""


@pytest.mark.judge
def test_sigterm_and_a_closed_terminal_end_a_drive_alike(tmp_path: Path) -> None:
    left: dict[str, Any] = {}
    for name, number, entry in (
        ("sigterm", signal.SIGTERM, None),
        ("closed", signal.SIGHUP, ("-c", ON_A_TERMINAL)),
    ):
        out = tmp_path / name / "runs"
        out.parent.mkdir()
        with started(out, *LIVE, entry=entry) as process:
            wait_for(partial(there, out, "*/drive.mcap"), "the drive")
            process.send_signal(number)
            screen, _ = process.communicate(timeout=240.0)
        run = run_folder(out)
        assert run is not None
        assert not any(map(is_running, child_pids(run).values()))
        assert "Traceback" not in screen
        tables = {path.name for path in (run / "results").iterdir()}
        record = foretwin.open_run(run).record
        left[name] = process.returncode, record["exit"], record["troubles"], tables

    ended = 130, "interrupted", [], {f"{name}.parquet" for name in TABLES}
    assert left == {"sigterm": ended, "closed": ended}


def there(out: Path, pattern: str) -> bool:
    return bool(list(out.glob(pattern)))
