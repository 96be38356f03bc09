"""The record of a killed run: what it had said, what lies in its files, and what is unknown."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from foretwin.contracts.drive import GnssFix
from foretwin.contracts.frames import GeoPoint
from foretwin.contracts.tally import read_tally, tally_file, write_tally
from foretwin.orchestrator.commands.recover import ledger_lines
from foretwin.orchestrator.record.recovery import recover
from foretwin.orchestrator.record.results import TABLES
from foretwin.orchestrator.record.run_streams import RunStreams
from foretwin.orchestrator.record.so_far import (
    SO_FAR,
    forget_so_far,
    read_so_far,
    so_far_bytes,
    write_so_far,
)
from foretwin.telemetry.processes.recording import DriveRecording
from tests.orchestrator.record.ended_badly import ROUNDS, killed_run

COVERS = ("foretwin.orchestrator.record.so_far",)

BASELINES = "nominal", "constant_velocity", "constant_turn_rate"
LEDGER = {
    "telemetry": {"published": 3, "recorded": 3, "lost": 0},
    "rounds": {"due": 4, "run": 1, "missed": 1, "spared": 0, "unseeded": 0, "given_up": 0},
    "jobs": {"given": 3, "results": 1, "refused": 1, "lost": 0},
}
"""Two rounds and a job are open."""
SAID = {
    "exit": "running", "ledger": LEDGER, "tuning": {"mode": "report"}, "drive_time_s": 0.6,
    "changes": [], "troubles": ["w1 ended"], "side_by_side": None, "off_road": [],
    "agreement": None, "plan_comparison": None, "telemetry": {"received": 3}, "dropped": {},
    "futures": {"missed_rounds": 1, "spared_rounds": 0, "unseeded_rounds": 0,
                "off_lanes_rounds": 2, "not_placed": {"behind": 3}, "failed": {"NaN": 1},
                "remarked": {}, "count": 12},
    "comparison": {}, "orchestrator": {"restarts": 0}, "workers": {}, "refused": {},
    "memory": {}, "left_out": {}, "wall_s": 1.0, "config": {"futures": 12, "keep": None},
}  # fmt: skip


def record_of(run: Path) -> dict[str, Any]:
    found: dict[str, Any] = json.loads((run / "run.json").read_text())
    return found


def killed(folder: Path, *, heard: int = 0) -> Path:
    run = killed_run(folder)
    write_so_far(run, so_far_bytes(SAID, {"gnss": heard}))
    return run


def recorded(run: Path, count: int, *, ends: bool) -> None:
    """Record numbered positions in place of what lies there; without an end as a kill leaves it."""
    (run / "drive.mcap").unlink()
    recording = DriveRecording(run / "drive.mcap")
    for number in range(count):
        fix = GnssFix(stamp_ns=number, position=GeoPoint(50.0, 8.0))
        recording.add("gnss", fix, sender=1, seq=number)
    recording.flush()
    left = {path: path.read_bytes() for path in run.glob("drive.*")}
    recording.finish()
    if not ends:
        for path, data in left.items():
            path.write_bytes(data)


def test_what_it_said_last_counts_and_tables_go_on_from_there(tmp_path: Path) -> None:
    run = killed(tmp_path / "run")
    done = recover(run)
    record = record_of(run)

    assert record["exit"] == "recovered"
    for name in ("tuning", "changes", "troubles", "off_road", "telemetry"):
        assert record[name] == SAID[name], name
    futures = record["futures"]
    assert (futures["count"], futures["wanted_per_round"], futures["smaller_rounds"]) == (36, 12, 0)
    assert (futures["missed_rounds"], futures["off_lanes_rounds"]) == (1, 2)
    assert futures["not_placed"] == {"behind": 3}
    assert (futures["failed"], futures["remarked"]) == ({"NaN": 1}, {})
    assert record["drive_time_s"] == 1.0  # of the last round
    assert record["recovered"] == {
        "lost": [], "unknown": ["ledger.telemetry"], "told_until_s": 0.6,
    }  # fmt: skip
    assert not (run / SO_FAR).exists()
    assert ledger_lines(done.record) == [
        "rounds: 4 due = 3 run + 1 missed + 0 spared + 0 unseeded + 0 given up",
        "jobs: 3 given = 1 results + 1 refused + 1 lost",
        "what no table tells is known up to 0.6 s of the drive",
        "unknown: ledger.telemetry",
    ]


def test_rounds_and_jobs_that_were_open_are_given_up_and_lost(tmp_path: Path) -> None:
    """Of the rounds the table has two more than had been told; they were the open ones."""
    run = killed(tmp_path / "run")
    recover(run)
    ledger = record_of(run)["ledger"]
    assert ROUNDS == 3
    assert ledger["rounds"] == LEDGER["rounds"] | {"run": 3}
    assert ledger["jobs"] == LEDGER["jobs"] | {"lost": 1}
    for name, all_of in (("rounds", "due"), ("jobs", "given")):
        counts = ledger[name]
        assert counts[all_of] == sum(n for of, n in counts.items() if of != all_of)


def test_rounds_that_fell_due_later_are_due_as_well(tmp_path: Path) -> None:
    run = killed_run(tmp_path / "run")
    rounds = {"due": 1, "run": 0, "missed": 1, "spared": 0, "unseeded": 0, "given_up": 0}
    said = SAID | {"ledger": LEDGER | {"rounds": rounds}}
    write_so_far(run, so_far_bytes(said, {}))
    recover(run)
    assert record_of(run)["ledger"]["rounds"] == rounds | {"due": 4, "run": 3}


def test_telemetry_is_counted_from_the_recording(tmp_path: Path) -> None:
    run = killed(tmp_path / "run", heard=7)
    recorded(run, 5, ends=True)
    recover(run)
    assert record_of(run)["ledger"]["telemetry"] == {
        "published": 7, "recorded": 5, "lost": 2,
        "lost_by": {"never_came": 2, "unwritten": 0, "refused": 0},
    }  # fmt: skip
    assert record_of(run)["recovered"]["unknown"] == []


def test_a_tally_that_counts_more_than_came_to_the_disk_is_not_believed(tmp_path: Path) -> None:
    run = killed(tmp_path / "run", heard=5)
    recorded(run, 5, ends=False)
    tally = read_tally(tally_file(run / "drive.mcap"))
    assert tally is not None
    tally.recorded["gnss"], tally.in_part = 9, 9
    tally.numbers.reach("gnss", 9, sender=1)
    write_tally(tally, tally_file(run / "drive.mcap"))
    recover(run)
    telemetry = record_of(run)["ledger"]["telemetry"]
    assert (telemetry["recorded"], telemetry["lost_by"]["unwritten"]) == (5, 4)


@pytest.mark.parametrize("data", [b"", b"{", b'{"record": 7}', b"\x00" * 64])
def test_what_it_said_may_be_torn_and_is_then_unknown(tmp_path: Path, data: bytes) -> None:
    run = killed(tmp_path / "run")
    (run / SO_FAR).write_bytes(data)
    (run / f"{SO_FAR}.writing").write_bytes(data)
    assert read_so_far(run) is None
    recover(run)
    assert {"tuning", "ledger.rounds"} < set(record_of(run)["recovered"]["unknown"])
    assert not list(run.glob(f"{SO_FAR}*"))
    forget_so_far(run)  # where there is nothing, nothing happens


def test_where_old_parts_are_gone_what_was_said_of_all_of_them_counts(tmp_path: Path) -> None:
    run = killed(tmp_path / "run")
    (run / "removed.json").write_bytes(b'{"rounds.parquet": {"parts": 1, "size_bytes": 5}}')
    recover(run)
    record = record_of(run)
    assert record["futures"] == SAID["futures"]
    assert record["ledger"]["rounds"] == LEDGER["rounds"] | {"given_up": 2}
    assert record["kept"]["removed"]["rounds.parquet"]["parts"] == 1


def test_siblings_are_counted_from_their_table(tmp_path: Path) -> None:
    run = killed_run(tmp_path / "run")
    streams = RunStreams(run / "results", {n: TABLES[n] for n in ("siblings", "comparisons")})
    rows = [
        {"round_id": number, "which": "nominal", "apart_4_s_m": 0.1 * number, "matters": False,
         "collided": False, "sibling_collided": False, "cpu_seconds": 0.1}
        for number in range(3)
    ]  # fmt: skip
    streams.take("siblings", rows)
    errors = dict.fromkeys((f"{name}_ade_m" for name in BASELINES), 1.0)
    driven = [
        {"round_id": n, "horizon_s": 4.0, "nominal_fde_m": 2.0 - n} | errors for n in (0, 1, 2)
    ]
    streams.take("comparisons", driven)
    streams.write(sync=True)
    streams.close()
    config = {"futures": 12, "keep": None, "siblings": {"engine": "multibody", "share": 0.2}}
    write_so_far(run, so_far_bytes(SAID | {"config": config}, {}))
    recover(run)
    told = record_of(run)["siblings"]
    assert (told["rounds"], told["with_reality"]) == (3, {"count": 3, "rank_correlation": -1.0})


@pytest.mark.parametrize(("ran", "independent"), [((True, False), True), ((False, False), False)])
def test_one_command_that_was_lost_does_not_make_a_twin_dependent(
    tmp_path: Path, ran: tuple[bool, ...], independent: bool
) -> None:
    run = killed_run(tmp_path / "run")
    streams = RunStreams(run / "results", {"mirror": TABLES["mirror"]})
    streams.take("mirror", [{"independent": one} for one in ran])
    streams.write(sync=True)
    streams.close()
    recover(run)
    assert record_of(run)["comparison"]["independent"] is independent
