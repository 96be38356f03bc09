"""What run.json would say so far lies on the disk while a drive goes on, and is gone at its end."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from foretwin.orchestrator.drive import record_keeper
from foretwin.orchestrator.drive.process_watch import ProcessWatch
from foretwin.orchestrator.drive.record_keeper import EVERY_S, RecordKeeper
from foretwin.orchestrator.drive.run_record import lost_lines
from foretwin.orchestrator.drive.supervision import Life, OwnProcesses
from foretwin.orchestrator.record.so_far import SO_FAR, read_so_far
from foretwin.orchestrator.runner.supervisor import Supervisor
from tests.orchestrator.drive.test_standing import watch
from tests.orchestrator.house import House
from tests.system.foretwin_command import wait_for


class Kept:
    """A drive under way, and who keeps its record; `given` is what was to be written."""

    def __init__(self, folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        self.house = House(folder)
        self.house.drive(20, round_every=10)
        self.watch: ProcessWatch = watch()
        self.watch.troubles.append("w1 ended")
        processes = OwnProcesses(self.house.plan, Supervisor(lambda **_: pytest.fail("starts")))
        conductor = self.house.conductor
        self.keeper = RecordKeeper(conductor, processes, self.watch, Life(0.0, ended_by=("CRASH",)))
        self.given: list[bytes] = []
        monkeypatch.setattr(conductor.tables, "keep_so_far", self.given.append)


@pytest.fixture
def kept(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Kept:
    return Kept(tmp_path, monkeypatch)


def test_it_is_told_every_two_seconds(kept: Kept) -> None:
    kept.keeper.mono_s = lambda: 0.0  # as long as it takes no time
    for tenth in range(45):
        kept.keeper.look(100.0 + tenth / 10.0)
    assert len(kept.given) == 3
    kept.house.tables.close()


def test_nothing_is_told_before_anything_was_heard(kept: Kept) -> None:
    kept.house.conductor.intake.counts.by_channel.clear()
    kept.keeper.look(100.0)
    assert kept.given == []
    kept.house.tables.close()


def test_it_takes_no_more_than_its_share_of_the_time(kept: Kept) -> None:
    times_s = iter([0.0, 0.5, 50.0, 50.1])  # half a second of work: 50 s until the next
    kept.keeper.mono_s = lambda: next(times_s)
    for now_s in (0.0, EVERY_S, 49.9):
        kept.keeper.look(now_s)
    assert len(kept.given) == 1
    kept.keeper.look(50.0)
    assert len(kept.given) == 2
    kept.house.tables.close()


def test_what_is_told_is_the_record_of_now(kept: Kept, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.undo()
    plan, conductor = kept.house.plan, kept.house.conductor
    conductor.rounds.tally.due = conductor.rounds.tally.ended + 1  # one is open
    kept.keeper.look(1.0)
    wait_for(lambda: read_so_far(plan.folder) is not None, "the record so far")
    so_far = read_so_far(plan.folder)
    assert so_far is not None
    assert so_far.record["exit"] == "running"
    assert so_far.record["troubles"][0] == "w1 ended"
    assert not any("balance" in text for text in so_far.record["troubles"])
    assert so_far.record["orchestrator"]["restarts"] == 1
    assert so_far.heard == conductor.intake.counts.by_channel
    assert so_far.heard["gnss"] == 20

    conductor.tables.close()
    record = kept.keeper.write("interrupted")
    assert json.loads((plan.folder / "run.json").read_text()) == json.loads(json.dumps(record))
    assert record["exit"] == "interrupted"
    assert any("balance" in text for text in record["troubles"])
    assert not (plan.folder / SO_FAR).exists()


def no_room(*_: object) -> None:
    raise OSError(30, "Read-only file system")


def test_a_record_that_cannot_be_written_is_told_with_what_to_do(
    kept: Kept, monkeypatch: pytest.MonkeyPatch
) -> None:
    plan = kept.house.plan
    kept.house.tables.close()
    (plan.folder / SO_FAR).write_text("kept")
    monkeypatch.setattr(record_keeper, "write_record", no_room)
    record = kept.keeper.write("completed")

    how = f"`foretwin recover {plan.folder}` makes it of what was written"
    told = f"error: run.json cannot be written: OSError: [Errno 30] Read-only file system; {how}"
    assert told in lost_lines(record)
    assert (plan.folder / SO_FAR).exists()  # of which `recover` makes it


def test_a_folder_that_loses_no_file_costs_nothing(
    kept: Kept, monkeypatch: pytest.MonkeyPatch
) -> None:
    kept.house.tables.close()
    monkeypatch.setattr(record_keeper, "forget_so_far", no_room)
    record = kept.keeper.write("completed")

    written = json.loads((kept.house.plan.folder / "run.json").read_text())
    assert written == json.loads(json.dumps(record))
    assert written["exit"] == "completed"
