"""The progress line: where the drive is, and the same for those who watch."""

from __future__ import annotations

import io
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import msgspec
import pytest

from foretwin.contracts.mailbox import Mailbox
from foretwin.contracts.simulation import Event
from foretwin.orchestrator.drive.progress import ProgressLine, waiting_text
from foretwin.orchestrator.rounds.pace import Pace
from foretwin.orchestrator.routing.arrival import NextJunction
from foretwin.telemetry.ros2.mapping import read_mapping
from tests.orchestrator.house import House


@pytest.fixture
def house(tmp_path: Path) -> Iterator[House]:
    made = House(tmp_path)
    yield made
    made.tables.close()


def watched(house: House, channel: str) -> Mailbox:
    mailbox = Mailbox(256)
    house.bus.subscribe(channel, mailbox, run=house.plan.run_id)
    return mailbox


def messages(mailbox: Mailbox) -> list:
    found = []
    while (item := mailbox.take()) is not None:
        found.append(item.message())
    return found


def test_the_next_junction_and_when_the_car_is_there(house: House) -> None:
    seen = watched(house, "progress")
    house.drive(20)
    with ProgressLine(house.conductor, house.mission) as line:
        line.update(100.0)
    (progress,) = messages(seen)

    assert progress.drive_time_s == pytest.approx(1.9)
    assert progress.mission_state == "following"
    assert "Mill Lane" in progress.next_intersection
    assert 5.0 < progress.arrival_in_s < 20.0
    assert progress.arrival_early_s is None  # nothing is forecast before the first round
    assert progress.dropped == 0


def test_with_a_round_it_is_said_between_when_and_when(
    house: House, capsys: pytest.CaptureFixture[str]
) -> None:
    seen = watched(house, "progress")
    house.drive(20, round_every=5)
    with ProgressLine(house.conductor, house.mission) as line:
        line.update(line._last_plain_s + 11.0)
    (progress,) = messages(seen)

    assert progress.arrival_early_s <= progress.arrival_in_s
    assert progress.arrival_late_s is None or progress.arrival_late_s >= progress.arrival_in_s
    assert progress.arrival_text in capsys.readouterr().err


def test_the_line_is_renewed_a_few_times_a_second_at_most(house: House) -> None:
    seen = watched(house, "progress")
    house.drive(5)
    with ProgressLine(house.conductor, house.mission) as line:
        for tick in range(100):
            line.update(100.0 + tick / 100)

    assert len(messages(seen)) == 4


def test_futures_per_second_are_those_of_the_last_seconds(house: House) -> None:
    seen = watched(house, "progress")
    with ProgressLine(house.conductor, house.mission) as line:
        for second in range(20):
            house.conductor.rounds.futures.count += 128 if second < 10 else 0
            line.update(100.0 + second)
    rates = [progress.futures_per_s for progress in messages(seen)]

    assert rates[0] == 0.0
    assert rates[9] == pytest.approx(128.0)
    assert rates[-1] == 0.0


def test_each_worker_is_idle_busy_or_dead(house: House) -> None:
    seen = watched(house, "worker_status")
    house.drive(20)
    assert house.conductor.start_round()
    house.workers[0].answer()
    house.settle()
    with ProgressLine(house.conductor, house.mission) as line:
        line.update(100.0)
        house.workers[1].die()
        house.settle()
        line.update(101.0)
    states = [(status.worker_id, status.state) for status in messages(seen)]

    assert states[:2] == [("w0", "idle"), ("w1", "busy")]
    assert states[3] == ("w1", "dead")


def test_without_a_terminal_a_plain_line_comes_now_and_then(
    house: House, capsys: pytest.CaptureFixture[str]
) -> None:
    house.drive(5)
    with ProgressLine(house.conductor, house.mission) as line:
        begun_s = line._last_plain_s
        for second in range(25):
            line.update(begun_s + second)
    lines = [row for row in capsys.readouterr().err.splitlines() if row]

    assert len(lines) == 2
    for word in ("following", "futures/s", "workers 2/2", "missed 0", "dropped 0"):
        assert word in lines[0]


def test_troubles_are_said_at_once_and_the_rest_is_not(
    house: House, capsys: pytest.CaptureFixture[str]
) -> None:
    line = ProgressLine(house.conductor, house.mission)
    line.tell(Event(stamp_ns=0, level="info", source="orchestrator", text="all is well"))
    line.tell(Event(stamp_ns=0, level="warning", source="recorder", text="the [disk] is full"))

    assert capsys.readouterr().err.strip() == "warning: recorder: the [disk] is full"


def test_the_line_says_what_a_slow_machine_leaves_out(
    house: House, capsys: pytest.CaptureFixture[str]
) -> None:
    seen = watched(house, "progress")
    house.drive(5)
    with ProgressLine(house.conductor, house.mission) as line:
        for number, pace in enumerate((Pace(6), Pace(3), Pace(1, 4)), start=1):
            house.conductor.rounds.pace.now = pace
            line.update(line._last_plain_s + 11.0 * number)
    said = [progress.too_slow for progress in messages(seen)]

    assert said == ["", "3 of 6 futures", "1 of 6 futures in 1 of 4 rounds"]
    assert "  3 of 6 futures (machine too slow for all)  " in capsys.readouterr().err


def test_who_waits_for_a_live_car_says_for_what_and_where(house: House) -> None:
    where = house.plan.bus.endpoint
    said = waiting_text(house.plan)
    vehicle = house.plan.config.vehicle_id
    assert said.startswith("waiting for a live car: its telemetry as ")
    assert said.endswith(f"/vehicle/{vehicle}/telemetry/… on {where}")
    by_ros2 = replace(house.plan, ros2=read_mapping(Path("autoware")))
    assert "the ROS 2 topics of " in waiting_text(by_ros2)


def test_a_street_named_like_markup_is_shown_as_it_is_named(
    house: House, monkeypatch: pytest.MonkeyPatch
) -> None:
    name = "[/a] Lane \x1b[2J"
    monkeypatch.setattr(
        type(house.mission), "next_junction", NextJunction(name, 5.0, 40.0, "j1", "signals")
    )
    monkeypatch.setenv("FORCE_COLOR", "1")
    house.drive(5)
    said = io.StringIO()
    line = ProgressLine(house.conductor, house.mission)
    line._console.file = said
    with line:
        line.update(100.0)
        line.tell(Event(stamp_ns=0, level="error", source="[/b]", text=f"{name}\nfake: line"))

    assert "[/a] Lane \\u001b[2J in 5 s" in said.getvalue()
    assert "error: [/b]: [/a] Lane \\u001b[2J\\nfake: line" in said.getvalue()
    assert "\x1b[2J" not in said.getvalue()


def test_before_a_junction_a_standing_car_waits(
    house: House, capsys: pytest.CaptureFixture[str]
) -> None:
    house.drive(5)
    stood = msgspec.structs.replace(house.states[5], speed_mps=0.0)
    for number in range(12):
        stamp_ns = stood.stamp_ns + number * 100_000_000
        state = msgspec.structs.replace(stood, stamp_ns=stamp_ns)
        house.mission.on_state(state, mono_s=0.0)
    assert house.mission.next_junction is not None
    assert house.mission.next_junction.in_s is None
    with ProgressLine(house.conductor, house.mission) as line:
        line.update(line._last_plain_s + 11.0)

    assert f"{house.mission.next_junction.name} waiting" in capsys.readouterr().err
