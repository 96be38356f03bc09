"""Times in a report are those of the drive, whatever clock the car has."""

from __future__ import annotations

from pathlib import Path

from foretwin.orchestrator.record.recorded_messages import CarRecorded
from foretwin.orchestrator.report.material import RunMaterial
from tests.orchestrator.report.told_runs import START_NS, run_without_junctions, told_run
from tests.sim_worker.places import state_at


def driven(*seconds: float) -> CarRecorded:
    """States of a log whose clock begins at 0."""
    return CarRecorded(
        tuple(state_at(0.0, 0.0, speed=s, stamp_ns=round(s * 1e9)) for s in seconds), ()
    )


def test_a_drive_that_began_within_a_log_is_where_its_rounds_say(tmp_path: Path) -> None:
    run = RunMaterial(told_run(tmp_path))
    run.rounds = [{"round_id": 0, "stamp_ns": 25_000_000_000, "drive_time_s": 25.0}]
    run.recorded = driven(20.0, 30.0, 39.0)

    assert run.track is not None
    assert run.track.time_s.tolist() == [20.0, 30.0, 39.0]


def test_without_a_round_the_recording_says_when_the_drive_began(tmp_path: Path) -> None:
    run = RunMaterial(run_without_junctions(tmp_path))
    assert run.start_stamp_ns == START_NS

    run = RunMaterial(run.folder)
    run.record = {**run.record, "config": {"start_s": 20.0}}
    run.recorded = driven(20.0, 30.0)
    assert run.start_stamp_ns == 0
    assert run.track is not None
    assert run.track.time_s.tolist() == [20.0, 30.0]


def test_a_recording_that_ends_before_the_rounds_do_is_said(tmp_path: Path) -> None:
    def unread(last_round_s: float) -> tuple[str, ...]:
        run = RunMaterial(told_run(tmp_path / str(last_round_s)))
        last_ns = round(last_round_s * 1e9)
        run.rounds = [{"round_id": 0, "stamp_ns": last_ns, "drive_time_s": last_round_s}]
        run.recorded = driven(20.0, 30.0, 39.0)
        return run.unread

    assert unread(40.0) == ()
    assert unread(45.0) == ("the recording of the car, drive.mcap, ends 6 s before the last round",)
