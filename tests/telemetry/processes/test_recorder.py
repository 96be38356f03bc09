"""The recorder process: on a bus in memory, and as a real process."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from foretwin.contracts.bus import Mailbox, Received, ZenohBus
from foretwin.contracts.codec import encode
from foretwin.contracts.drive import DriveEnd, SpeedSample
from foretwin.contracts.keys import key as channel_key
from foretwin.contracts.simulation import RunEnd
from foretwin.telemetry.logs import open_log
from foretwin.telemetry.processes.recording import DriveRecording
from tests.contracts.bus_sides import DEADLINE_S
from tests.contracts.memory_bus import MemoryBus
from tests.starvation import unhindered_wait_s
from tests.telemetry.drive_messages import INFO, START_NS, every_channel
from tests.telemetry.own_recordings import read_drive
from tests.telemetry.processes.recorder_process import ORCHESTRATOR, recorder_process
from tests.telemetry.processes.small_disk import Disk
from tests.telemetry.processes.wired_recorder import SETUP, Wall, recorder


def publish_all(bus: MemoryBus | ZenohBus) -> None:
    for channel, message in every_channel():
        bus.publish(channel, message, vehicle="car")


def test_what_is_missing_is_asked_for_once_more(tmp_path: Path) -> None:
    wall, bus = Wall(), MemoryBus()
    process = recorder(bus, DriveRecording(tmp_path / "drive.mcap"), lossless=False, mono_s=wall)
    for seq in (0, 5):
        speed = SpeedSample(stamp_ns=START_NS + seq, speed_mps=1.0)
        mailbox = bus.mailboxes("speed")[0]
        data = encode(speed, seq=seq, sent_ns=seq)
        mailbox.put(Received("speed", channel_key("speed", vehicle="car"), data, SpeedSample))
    for _ in range(4):
        assert process.step()
        wall.now_s += 1.0
    assert bus.recovered == [channel_key("speed", vehicle="car")]
    end = DriveEnd(stamp_ns=START_NS + 9, published={"speed": 6, "imu": 1})
    bus.publish("end", end, vehicle="car")
    assert process.step()
    assert set(bus.recovered[1:]) == {channel_key(one, vehicle="car") for one in ("speed", "imu")}
    process.finish()


@pytest.mark.parametrize(("run_ended", "lossless"), [(True, False), (False, False), (False, True)])
def test_who_is_ended_alone_leaves_what_waits_to_the_next_one(
    tmp_path: Path, run_ended: bool, lossless: bool
) -> None:
    bus, disk = MemoryBus(), Disk(0)
    recording = DriveRecording(tmp_path / "drive.mcap", open_part=disk.open_part)
    process = recorder(bus, recording, lossless=lossless)
    bus.publish("speed", SpeedSample(stamp_ns=START_NS, speed_mps=1.0), vehicle="car")
    if run_ended:
        bus.publish("run_end", RunEnd(stamp_ns=1), run="r1")
    process.step()
    process.finish()
    lost = {"speed": 1} if run_ended or lossless else {}
    assert recording.tally.unwritten == lost


def test_all_channels_and_the_vehicle_are_recorded(tmp_path: Path) -> None:
    bus, path, questions = MemoryBus(), tmp_path / "drive.mcap", Mailbox(4)
    bus.serve("info", questions, vehicle="car")
    process = recorder(bus, DriveRecording(path))
    publish_all(bus)
    assert process.step()
    questions.take().reply(INFO)
    bus.publish("run_end", RunEnd(stamp_ns=1), run="r1")
    assert not process.step()
    process.finish()
    assert [channel for channel, _ in read_drive(path)] == [c for c, _ in every_channel()]
    assert open_log(path).info.body_from_antenna_m == INFO.body_from_antenna_m


def test_in_lock_step_nothing_is_left_out_however_slow_the_machine_is(tmp_path: Path) -> None:
    class Slow(Wall):
        def __call__(self) -> float:
            self.now_s += 1.0
            return self.now_s

    bus, path = MemoryBus(), tmp_path / "drive.mcap"
    recording = DriveRecording(path)
    process = recorder(bus, recording, mono_s=Slow())
    publish_all(bus)
    process.finish()
    assert [channel for channel, _ in read_drive(path)] == [c for c, _ in every_channel()]


def test_a_vehicle_that_does_not_answer_is_recorded_all_the_same(tmp_path: Path) -> None:
    bus, path = MemoryBus(), tmp_path / "drive.mcap"
    process = recorder(bus, DriveRecording(path))
    publish_all(bus)
    assert process.step()
    process.finish()
    assert open_log(path).info.start_stamp_ns == START_NS


def test_a_write_error_reaches_the_bus_and_the_process_goes_on(tmp_path: Path) -> None:
    bus, events, disk = MemoryBus(), Mailbox(10), Disk(0)
    bus.subscribe("event", events, run="r1")
    process = recorder(bus, DriveRecording(tmp_path / "drive.mcap", open_part=disk.open_part))
    publish_all(bus)
    assert process.step()
    event = events.take().message()
    assert (event.level, event.source) == ("error", "recorder")
    assert "No space left on device" in event.text
    assert len(events) == 0


def test_it_leaves_when_the_orchestrator_is_gone_but_not_before_it_came(tmp_path: Path) -> None:
    bus, wall = MemoryBus(), Wall()
    recording = DriveRecording(tmp_path / "drive.mcap")
    process = recorder(bus, recording, mono_s=wall)
    wall.now_s = 100.0
    assert process.step(), "it never saw the orchestrator"
    bus.declare_alive(ORCHESTRATOR)
    assert process.step()
    bus.lose(ORCHESTRATOR)
    assert process.step(), "a link may come back"
    bus.declare_alive(ORCHESTRATOR)
    wall.now_s += 2.0 * SETUP.grace_s
    assert process.step()
    bus.lose(ORCHESTRATOR)
    assert process.step()
    wall.now_s += 1.1 * SETUP.grace_s
    assert not process.step()
    process.finish()


def test_what_came_is_in_the_file_and_on_the_disk_a_second_later(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A kill, or a power cut, takes along what came in the last second alone."""
    bus, wall, path = MemoryBus(), Wall(), tmp_path / "drive.mcap"
    on_the_disk: list[list[str]] = []
    monkeypatch.setattr(os, "fdatasync", lambda _: on_the_disk.append(channels_in(path)))
    process = recorder(bus, DriveRecording(path), lossless=False, mono_s=wall)
    publish_all(bus)
    assert process.step()
    assert on_the_disk == []
    wall.now_s = 1.0
    assert process.step()
    assert on_the_disk == [[channel for channel, _ in every_channel()]]
    process.finish()


def channels_in(path: Path) -> list[str]:
    return [channel for channel, _ in read_drive(path)]


def test_what_is_missing_is_counted_and_told(tmp_path: Path) -> None:
    bus, events, wall = MemoryBus(), Mailbox(10), Wall()
    bus.subscribe("event", events, run="r1")
    recording = DriveRecording(tmp_path / "drive.mcap")
    process = recorder(bus, recording, lossless=False, mono_s=wall)
    bus.publish("speed", SpeedSample(stamp_ns=START_NS, speed_mps=0.0), vehicle="car")
    assert process.step()
    for number in range(1, 20_011):
        sample = SpeedSample(stamp_ns=START_NS + number, speed_mps=0.0)
        bus.publish("speed", sample, vehicle="car")
    wall.now_s = 2.0
    assert process.step()
    event = events.take().message()
    assert event.level == "warning"
    assert event.text.startswith("10 messages are missing")
    assert "10 dropped" in event.text
    process.finish()


def test_losses_are_told_again_when_there_are_twice_as_many_and_at_the_end(tmp_path: Path) -> None:
    bus, events, wall = MemoryBus(), Mailbox(32), Wall()
    bus.subscribe("event", events, run="r1")
    recording = DriveRecording(tmp_path / "drive.mcap")
    process = recorder(bus, recording, lossless=False, mono_s=wall)
    nobody = Mailbox(1)
    sample = SpeedSample(stamp_ns=START_NS, speed_mps=0.0)
    process._messages, kept = nobody, process._messages
    for second in range(10):
        bus.publish("speed", sample, vehicle="car")
        bus.publish("speed", sample, vehicle="car")
        kept.take()  # every second one is lost
        nobody.put(kept.take())
        wall.now_s = 2.0 * second
        assert process.step()
    process.finish()
    told = []
    while (item := events.take()) is not None:
        told.append(int(item.message().text.split()[0]))

    assert told == [1, 3, 7, 9]


@pytest.fixture
def started(tmp_path: Path) -> Iterator[tuple[ZenohBus, Mailbox, Any]]:
    """See recorder_process."""
    with recorder_process(tmp_path) as everything:
        yield everything


@pytest.mark.parametrize("by", ["run_end", "SIGTERM"])
def test_the_process_ends_within_a_second_with_a_whole_file(
    tmp_path: Path, started: tuple[ZenohBus, Mailbox, Any], by: str
) -> None:
    bus, _, process = started
    states = Mailbox(100)
    bus.subscribe("state", states, vehicle="car")
    publish_all(bus)
    assert isinstance(states.take(DEADLINE_S), Received)
    process.send_signal(signal.SIGINT)
    with pytest.raises(subprocess.TimeoutExpired):
        process.wait(0.3)
    if by == "run_end":
        bus.publish("run_end", RunEnd(stamp_ns=1), run="r1")
    else:
        process.send_signal(signal.SIGTERM)
    assert unhindered_wait_s(process, DEADLINE_S) < 1.5
    assert process.returncode == 0
    found = [channel for channel, _ in read_drive(tmp_path / "drive.mcap")]
    assert found == [channel for channel, _ in every_channel()]


def test_a_wrong_setup_is_told_without_a_traceback(tmp_path: Path) -> None:
    (tmp_path / "setup.json").write_text('{"run_id": 5}')
    done = subprocess.run(
        [
            sys.executable,
            "-m",
            "foretwin.telemetry.processes.recorder",
            "--setup",
            str(tmp_path / "setup.json"),
        ],
        capture_output=True,
        text=True,
        timeout=DEADLINE_S,
        check=False,
    )
    assert done.returncode == 2
    assert "setup.json: Expected `str`, got `int` - at `$.run_id`" in done.stderr
    assert "Traceback" not in done.stderr
