"""A car behind a link that is cut for a second and a half: nothing of it is lost."""

from __future__ import annotations

import json
import threading
import time
from collections import Counter
from contextlib import ExitStack
from pathlib import Path
from typing import Any

from foretwin.contracts.bus import Mailbox, ZenohBus
from foretwin.contracts.drive import DriveEnd, ImuSample, SpeedSample, SteeringSample
from foretwin.contracts.keys import alive_key
from foretwin.contracts.setup import BusSetup
from foretwin.contracts.simulation import RunEnd
from foretwin.contracts.tally import read_tally, tally_file
from tests.contracts.bus_sides import DEADLINE_S
from tests.contracts.cut_link import CutLink
from tests.telemetry.drive_messages import START_NS
from tests.telemetry.own_recordings import read_drive
from tests.telemetry.processes.recorder_process import recorder_process


def test_a_cut_of_the_cars_link_for_a_second_and_a_half_loses_nothing(tmp_path: Path) -> None:
    """A car at 300 messages a second, behind a proxy that ends its connection."""
    pause, sent, cut_at, mend_at, end_at = threading.Event(), 0, 150, 600, 900
    with ExitStack() as stack:
        bus, _, process = stack.enter_context(recorder_process(tmp_path, lossless=False))
        router = json.loads((tmp_path / "setup.json").read_text())["bus"]["endpoint"]
        link = stack.enter_context(CutLink(router))
        car = stack.enter_context(ZenohBus(BusSetup(endpoint=link.endpoint)))
        alive = Mailbox(10)
        bus.watch_alive(alive_key(run="r1", process="car"), alive)
        car.declare_alive(alive_key(run="r1", process="car"))
        assert alive.take(DEADLINE_S).up
        begun_s = time.monotonic()
        while sent < end_at:
            if sent == cut_at:
                link.cut()
            elif sent == mend_at:
                link.mend()
            for channel in ("imu", "speed", "steering"):
                car.publish(channel, sample_of(channel, sent), vehicle="car")
            sent += 3
            pause.wait(max(0.0, begun_s + sent / 300.0 - time.monotonic()))
        published = dict.fromkeys(("imu", "speed", "steering"), sent // 3)
        assert not alive.take(DEADLINE_S).up
        assert alive.take(DEADLINE_S).up, "the car is back"
        ends = Mailbox(10)
        bus.subscribe("end", ends, vehicle="car")
        while ends.take(0.2) is None:
            car.publish("end", DriveEnd(stamp_ns=START_NS, published=published), vehicle="car")
        tally = tally_file(tmp_path / "drive.mcap")
        deadline_s = time.monotonic() + DEADLINE_S
        while time.monotonic() < deadline_s and not has_all(tally, published):
            pause.wait(0.05)
        bus.publish("run_end", RunEnd(stamp_ns=1), run="r1")
        process.wait(DEADLINE_S)
    found = read_tally(tally)
    assert found is not None
    assert {name: found.recorded[name] for name in published} == published
    assert found.numbers.missing.total() == 0
    samples = Counter(channel for channel, _ in read_drive(tmp_path / "drive.mcap"))
    assert {name: samples[name] for name in published} == published


def has_all(tally: Path, published: dict[str, int]) -> bool:
    found = read_tally(tally)
    return found is not None and all(
        found.recorded.get(name) == count for name, count in published.items()
    )


def sample_of(channel: str, number: int) -> Any:
    stamp_ns = START_NS + number
    if channel == "imu":
        zero = (0.0, 0.0, 0.0)
        return ImuSample(stamp_ns=stamp_ns, accel_mps2=zero, rate_radps=zero)
    if channel == "speed":
        return SpeedSample(stamp_ns=stamp_ns, speed_mps=1.0)
    return SteeringSample(stamp_ns=stamp_ns, steering_wheel_rad=0.1)
