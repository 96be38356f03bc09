"""A recorder asks a few times more for what does not come by itself."""

from __future__ import annotations

from pathlib import Path

from foretwin.contracts.codec import encode
from foretwin.contracts.drive import SpeedSample
from foretwin.contracts.keys import key
from foretwin.contracts.mailbox import Received
from foretwin.telemetry.processes.missed import MissedSamples
from foretwin.telemetry.processes.recording import DriveRecording
from tests.contracts.memory_bus import MemoryBus
from tests.telemetry.drive_messages import START_NS
from tests.telemetry.processes.test_recorder import Wall, recorder


def asked(missed: MissedSamples, missing: dict[str, int], from_s: int, to_s: int) -> list[int]:
    return [at_s for at_s in range(from_s, to_s) if missed.due(missing, float(at_s))]


def test_what_stays_missing_is_asked_for_a_few_times() -> None:
    assert asked(MissedSamples(), {"gnss": 49}, 10, 60) == [12, 16, 24]


def test_who_follows_another_asks_at_once_and_then_as_others_do() -> None:
    missed = MissedSamples(first_s=0.0)
    assert asked(missed, {"gnss": 49}, 10, 60) == [10, 14, 22]
    assert asked(missed, {"gnss": 50}, 60, 64) == [62]


def test_what_comes_by_itself_is_not_asked_for() -> None:
    missed = MissedSamples()
    assert asked(missed, {"gnss": 49}, 0, 2) == []
    assert asked(missed, {"gnss": 0}, 2, 4) == []
    assert asked(missed, {"gnss": 3}, 4, 8) == [6], "a new gap has its own time"


def test_more_that_is_missing_is_asked_for_anew() -> None:
    missed = MissedSamples()
    assert asked(missed, {"gnss": 49}, 0, 40) == [2, 6, 14]
    assert asked(missed, {"gnss": 40}, 40, 80) == [], "fewer are no growth"
    assert asked(missed, {"gnss": 50}, 80, 84) == [82]


def test_what_grows_all_the_time_is_asked_for_all_the_same() -> None:
    missed = MissedSamples()
    times = [at_s for at_s in range(20) if missed.due({"imu": 1 + at_s}, float(at_s))]
    assert len(times) > 4


def test_each_channel_is_asked_for_by_itself() -> None:
    missed = MissedSamples()
    assert missed.due({"imu": 2, "gnss": 0}, 0.0) == []
    assert missed.due({"imu": 2, "gnss": 1}, 2.0) == ["imu"]
    assert missed.due({"imu": 2, "gnss": 1}, 4.0) == ["gnss"]


def test_at_the_end_all_that_is_missing_is_asked_for() -> None:
    missed = MissedSamples()
    assert missed.due({"imu": 2, "gnss": 0, "plan": 1}, 0.0, at_once=True) == ["imu", "plan"]


def test_a_recorder_that_follows_another_asks_at_its_first_look(tmp_path: Path) -> None:
    looks = []
    for seqs in ((0,), (5, 6)):
        wall, bus = Wall(), MemoryBus()
        recording = DriveRecording(tmp_path / "drive.mcap")
        process = recorder(bus, recording, lossless=False, mono_s=wall)
        for seq in seqs:
            data = encode(SpeedSample(stamp_ns=START_NS + seq, speed_mps=1.0), seq=seq, sent_ns=seq)
            speed = key("speed", vehicle="car")
            bus.mailboxes("speed")[0].put(Received("speed", speed, data, SpeedSample))
        assert process.step()
        wall.now_s += 1.0
        assert process.step()
        looks.append(bus.recovered)
        process.finish()
    assert looks == [[], [key("speed", vehicle="car")]]
