"""Recovering runs: everything that is whole can be read afterwards, and what is not is said."""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Callable
from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from mcap.reader import make_reader

from foretwin.contracts.errors import UserError
from foretwin.contracts.process import hold
from foretwin.orchestrator.record import recovery
from foretwin.orchestrator.record.recovery import recover
from foretwin.orchestrator.record.results import TABLES
from foretwin.orchestrator.record.run_state import run_lock
from foretwin.orchestrator.record.table_parts import read_parts
from foretwin.telemetry.logs.mend_mcap import look_through
from tests.orchestrator.record.ended_badly import ROUNDS, event, killed_run


def contents(folder: Path) -> dict[str, bytes]:
    return {
        str(path.relative_to(folder)): path.read_bytes()
        for path in sorted(folder.rglob("*"))
        if path.is_file()
    }


def test_a_killed_run_is_read_to_its_last_row(tmp_path: Path) -> None:
    run = killed_run(tmp_path / "run")
    done = recover(run)

    assert (done.exit_word, done.lost, done.healthy) == ("recovered", [], False)
    assert {path.name for path in (run / "results").iterdir()} == {f"{t}.parquet" for t in TABLES}
    events = pq.read_table(run / "results" / "events.parquet")
    assert events.to_pylist() == [event(number) for number in range(ROUNDS)]
    assert {"rounds: 3 rows", "events: 3 rows", "futures: 0 rows"} < {p.text for p in done.parts}
    assert "drive.mcap: 5 messages, up to stamp 4000000000 ns" in {p.text for p in done.parts}
    assert json.loads((run / "log.jsonl").read_text())["text"] == "what it said last"


def test_a_run_killed_before_it_had_begun_its_tables_has_all_of_them_empty(tmp_path: Path) -> None:
    run = killed_run(tmp_path / "run")
    results = run / "results"
    for stream in results.glob("*.arrows"):
        if stream.stem not in {"events", "jobs", "rounds"}:
            stream.unlink()
    for begun in ("jobs", "rounds"):
        os.truncate(results / f"{begun}.arrows", 0)
    done = recover(run)

    assert done.lost == []
    assert {path.name for path in results.iterdir()} == {f"{t}.parquet" for t in TABLES}
    rows = {name: read_parts(results / f"{name}.parquet").num_rows for name in TABLES}
    assert {name for name, count in rows.items() if count} == {"events"}
    recovered = contents(run)
    assert recover(run).healthy
    assert contents(run) == recovered


def test_the_record_says_what_the_tables_tell_and_no_more(tmp_path: Path) -> None:
    run = killed_run(tmp_path / "run")
    recover(run)
    record = json.loads((run / "run.json").read_text())

    digest = hashlib.sha256(b"".join(bytes.fromhex(f"{n:064x}") for n in range(ROUNDS)))
    words = record.pop("recovered")
    unknown = set(words.pop("unknown"))
    assert words == {"lost": [], "told_until_s": None}
    assert {name for name, value in record.items() if value is None} | {
        "futures.missed_rounds", "futures.spared_rounds", "futures.unseeded_rounds",
        "futures.off_lanes_rounds", "futures.not_placed", "futures.failed",
        "futures.remarked",
        "ledger.telemetry", "ledger.rounds", "ledger.jobs",
    } == unknown | {"agreement", "siblings"}  # fmt: skip
    assert {n: value for n, value in record.items() if value is not None} == {
        "run_id": "r1",
        "exit": "recovered",
        "seed": 7,
        "futures": {
            "count": 36, "wanted_per_round": None, "smaller_rounds": None,
            "rounds_by_futures": {"12": 3}, "distinct": 33,
            "distinct_min_per_round": 10, "missed_rounds": None, "spared_rounds": None,
            "unseeded_rounds": None, "off_lanes_rounds": None, "not_placed": None,
            "failed": None, "remarked": None,
            "rounds": 3, "late_rounds": 0, "sim_seconds": 288.0, "cpu_seconds": 0.75,
            "sha256": digest.hexdigest(),
        },
        "state_to_result_ms_p50": 101.0,
        "state_to_result_ms_p95": 101.9,
        "intersections": [],
        "drive_time_s": 1.0,
        "processor": {},
        "refused_by_router": {"count": 0, "counted_all": True, "by_role": []},
        "refused_by_processes": {"count": 0, "by_process": []},
        "ledger": {"telemetry": None, "rounds": None, "jobs": None},
    }  # fmt: skip


def test_recovering_again_changes_nothing(tmp_path: Path) -> None:
    run = killed_run(tmp_path / "run")
    os.truncate(run / "results" / "rounds.arrows", 4000)
    assert recover(run).lost
    before = contents(run)

    assert recover(run).healthy
    assert contents(run) == before


def test_a_torn_end_is_said_and_what_is_before_it_is_kept(tmp_path: Path) -> None:
    run = killed_run(tmp_path / "run")
    stream = run / "results" / "events.arrows"
    os.truncate(stream, stream.stat().st_size - 1)
    os.truncate(run / "drive.mcap", look_through(run / "drive.mcap").data_bytes * 7 // 10)
    done = recover(run)

    table, recording = done.lost
    assert table.startswith("events: 2 rows; a torn end of ")
    assert recording.startswith("drive.mcap: ")
    assert recording.endswith(" bytes is lost")
    assert json.loads((run / "run.json").read_text())["recovered"]["lost"] == done.lost
    assert pq.read_table(run / "results" / "events.parquet").num_rows == 2
    with (run / "drive.mcap").open("rb") as file:
        read = list(make_reader(file, validate_crcs=True).iter_messages())
    assert 0 < len(read) < 5
    assert f": {len(read)} messages, up to stamp {len(read) - 1}" in recording


@pytest.mark.parametrize("step", ["write_record", "fold_stderr"])
def test_a_recovery_that_is_interrupted_is_done_again_to_the_same(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, step: str
) -> None:
    run, same = killed_run(tmp_path / "a"), killed_run(tmp_path / "b")
    for one in (run, same):
        os.truncate(one / "results" / "events.arrows", 1200)

    def dies(*_: object) -> None:
        raise KeyboardInterrupt

    with monkeypatch.context() as patched:
        patched.setattr(recovery, step, dies)
        with pytest.raises(KeyboardInterrupt):
            recover(run)
    recover(run)
    recover(same)
    without_log = [
        {name: data for name, data in contents(one).items() if "processes" not in name}
        for one in (run, same)
    ]
    if step == "fold_stderr":  # what was said last still lies where it was
        without_log = [{n: d for n, d in one.items() if n != "log.jsonl"} for one in without_log]
    assert without_log[0] == without_log[1]


def test_a_full_disk_leaves_what_was_there(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    run = killed_run(tmp_path / "run")
    before = contents(run)

    def no_room(*_: object) -> None:
        raise OSError(28, "No space left on device")

    with monkeypatch.context() as patched:
        patched.setattr(pq.ParquetWriter, "write_table", no_room)
        with pytest.raises(UserError, match=r"cannot be recovered: OSError: .* No space left"):
            recover(run)
    assert contents(run).items() >= before.items()
    assert recover(run).lost == []


def test_a_record_that_is_torn_is_written_anew(tmp_path: Path) -> None:
    run = killed_run(tmp_path / "run")
    (run / "run.json").write_text('{"run_id": "r1", "ex')
    recover(run)

    record = json.loads((run / "run.json").read_text())
    assert (record["run_id"], record["exit"]) == ("run", "recovered")
    assert record["futures"]["rounds"] == 3


def test_what_the_trace_has_is_joined(tmp_path: Path) -> None:
    run = killed_run(tmp_path / "run")
    (run / "trace").mkdir()
    (run / "trace" / "w0-7.trace").write_bytes(b'{"ph":"X","name":"job"}\n{"ph":"X","na')
    recover(run)

    assert json.loads((run / "trace.json").read_bytes())["traceEvents"] == [
        {"ph": "X", "name": "job"}
    ]
    assert not (run / "trace").exists()


def test_a_run_that_goes_on_is_left_alone(tmp_path: Path) -> None:
    run = killed_run(tmp_path / "run")
    with run_lock(run), pytest.raises(UserError, match="the drive still runs"):
        recover(run)
    assert recover(run).exit_word == "recovered"


def test_the_recorder_may_first_end_its_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    run = killed_run(tmp_path / "run")
    setup = run / "processes" / "recorder.json"
    setup.write_text("{}")
    descriptor = hold(setup)
    monkeypatch.setattr(recovery, "LEAVE_S", 0.0)
    with pytest.raises(UserError, match="recorder of the drive still runs"):
        recover(run)
    os.close(descriptor)

    assert recover(run).exit_word == "recovered"


def cut(data: bytes) -> bytes:
    return data[:4]


def flip_a_byte(data: bytes) -> bytes:
    """In the end of the last page: the file's end, which tells of all columns, stays whole."""
    end = len(data) - 8 - int.from_bytes(data[-8:-4], "little")
    return data[: end - 1] + bytes([data[end - 1] ^ 0x01]) + data[end:]


@pytest.mark.parametrize("spoil", [cut, flip_a_byte])
def test_a_table_whose_parquet_is_damaged_is_said(
    tmp_path: Path, spoil: Callable[[bytes], bytes]
) -> None:
    run = killed_run(tmp_path / "run")
    recover(run)
    events = run / "results" / "events.parquet"
    events.write_bytes(spoil(events.read_bytes()))
    done = recover(run)

    assert not done.healthy
    assert [text.split(":")[0] for text in done.lost] == ["events"]


def test_what_is_no_run_is_told(tmp_path: Path) -> None:
    with pytest.raises(UserError, match="no folder of a run"):
        recover(tmp_path)


def test_a_run_in_parts_is_recovered_with_all_of_them(tmp_path: Path) -> None:
    run = killed_run(tmp_path / "run")
    results, recording = run / "results", run / "drive.mcap"
    # Killed as it put a table away for the second time; the oldest part of the recording is gone.
    (results / "events.arrows").rename(results / "events-002.arrows")
    pq.write_table(pq_of(event(-1)), results / "events-001.parquet")
    recording.rename(run / "drive-002.mcap")
    (run / "removed.json").write_bytes(b'{"drive.mcap": {"parts": 1, "size_bytes": 5}}')
    os.truncate(run / "drive-002.mcap", look_through(run / "drive-002.mcap").data_bytes)
    done = recover(run)

    assert done.lost == []
    told = [part.text.split(",")[0] for part in done.parts]
    assert "events-001: 1 rows" in told
    assert "events-002: 3 rows" in told
    assert "drive-002.mcap: 5 messages" in told
    assert look_through(run / "drive-002.mcap").ended
    read = read_parts(results / "events.parquet")["stamp_ns"].to_pylist()
    assert read == [event(number)["stamp_ns"] for number in (-1, *range(ROUNDS))]
    assert json.loads((run / "run.json").read_text())["kept"]["removed"]["drive.mcap"]["parts"] == 1
    assert recover(run).healthy


def pq_of(row: dict[str, object]) -> pa.Table:
    return pa.Table.from_pylist([row], schema=TABLES["events"])
