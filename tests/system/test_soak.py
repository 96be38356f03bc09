"""Nothing grows with a drive: what takes each sample, and real processes over half an hour.

For the first sixth of the half hour the car says ten times as much: what that needs at most is not
given back, and must not look like growth.
"""

from __future__ import annotations

import json
import math
import os
from collections.abc import Callable
from pathlib import Path

import msgspec
import numpy as np
import pytest

from foretwin.contracts import running
from foretwin.contracts.drive import GnssFix, ImuSample, SpeedSample
from foretwin.contracts.keys import CHANNELS
from foretwin.contracts.mailbox import Mailbox
from foretwin.contracts.segments import Roll
from foretwin.orchestrator.drive.intake import Intake
from foretwin.orchestrator.record.bookkeeping import FuturesCount
from foretwin.telemetry.processes.recording import DriveRecording
from foretwin.viewer.monitor import Monitor
from tests.contracts.memory_bus import MemoryBus
from tests.growth import entries
from tests.orchestrator.futures_rounds import round_done, straight
from tests.orchestrator.house import INFO
from tests.orchestrator.trip import START_NS, states_along, town
from tests.system.busy_car import SPELL_S
from tests.system.circuit import write_circuit
from tests.system.foretwin_command import Finished, run_folder, started
from tests.viewer import scene
from tests.viewer.shown import monitor_of

SOAK_MIN = float(os.environ.get("FORETWIN_SOAK_MIN", "30"))
"""How long the drive with real processes lasts."""
MOST_MB_PER_H = 5.0
VIEW_PART_MB = 40.0
"""What Rerun holds of the file that the viewer writes, at most: its index goes with each part."""
LAP_S = 180.0
"""The stand-in car needs longer for a lap of the circuit."""
CALM_HZ = 320.0
"""So many samples a stand-in car sends in each second, at most."""
DAY_GB = 40.0
"""What a drive of 24 h leaves, extrapolated; `--keep` bounds it."""
WITH_A_BUSY_CAR = """
from foretwin.__main__ import main
from foretwin.orchestrator.runner.fork_launch import Forks
from foretwin.orchestrator.runner.launch import FreshInterpreter

class Launcher(Forks):
    def __call__(self, *, module, setup):
        if module != "telemetry.standin":
            return super().__call__(module=module, setup=setup)
        other = FreshInterpreter(self._folder, package="tests.system")
        return other(module="busy_car", setup=setup)

from foretwin.orchestrator.drive import launching
launching.Forks = Launcher
main()
"""
"""A drive whose stand-in car is that of `busy_car`."""
SAMPLES, GROWN_BY = 1500, 300
"""Of latencies classes are counted: a machine that stumbles has some that were not there before."""
STEP_NS = 20_000_000
Feed = Callable[[int], None]
"""Gives one more sample, the n-th."""


def intake() -> tuple[Intake, Feed]:
    bus, mailbox, made = MemoryBus(), Mailbox(64), Intake(town().vehicle)
    for channel in ("gnss", "imu", "speed"):
        bus.subscribe(channel, mailbox, vehicle="ego")
    made.take_info(INFO)
    place = states_along(town().graph.frame, np.array([[0.0, 0.0], [50.0, 0.0]]))[0].position

    def feed(number: int) -> None:
        stamp_ns = START_NS + number * STEP_NS
        still = (0.0, 0.0, 0.0)
        bus.publish("gnss", GnssFix(stamp_ns=stamp_ns, position=place), vehicle="ego")
        bus.publish("speed", SpeedSample(stamp_ns=stamp_ns, speed_mps=0.0), vehicle="ego")
        imu = ImuSample(stamp_ns=stamp_ns, accel_mps2=still, rate_radps=still)
        bus.publish("imu", imu, vehicle="ego")
        while (item := mailbox.take()) is not None:
            made.take(item)

    return made, feed


def recording(folder: Path) -> tuple[DriveRecording, Feed]:
    made = DriveRecording(folder / "drive.mcap", roll=Roll(most_bytes=20_000))

    def feed(number: int) -> None:
        sample = SpeedSample(stamp_ns=START_NS + number * STEP_NS, speed_mps=number % 7)
        made.add("speed", sample, sender=1 + number // 400, seq=number)
        if number % 10 == 0:
            made.flush()

    return made, feed


def view() -> tuple[Monitor, Feed]:
    made = monitor_of()
    messages = [one for one in scene.drive(duration_s=4.0) if one.channel in CHANNELS]

    def feed(number: int) -> None:
        turn, place = divmod(number, len(messages))
        channel, message = messages[place]
        stamp_ns = getattr(message, "stamp_ns", None)
        if stamp_ns is not None:
            later = stamp_ns + turn * 4_000_000_000
            message = msgspec.structs.replace(message, stamp_ns=later)
        made.handle(channel, message)

    return made, feed


def rounds() -> tuple[FuturesCount, Feed]:
    made, done = FuturesCount(), round_done(straight(), latency_ms=80.0)
    return made, lambda _: made.take(done, distinct=1) and None


@pytest.mark.parametrize("what", ["intake", "recording", "view", "rounds"])
def test_who_takes_each_sample_keeps_none(
    what: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(running, "EXACT", 100)
    makers = {"intake": intake, "view": view, "rounds": rounds}
    root, feed = recording(tmp_path) if what == "recording" else makers[what]()
    for number in range(SAMPLES):
        feed(number)
    before = entries(root)
    for number in range(SAMPLES, 2 * SAMPLES):
        feed(number)
    grown = entries(root) - before
    if isinstance(root, DriveRecording):
        root.finish()
    assert grown < GROWN_BY


def test_a_list_of_all_samples_would_be_noticed() -> None:
    class Kept:
        def __init__(self) -> None:
            self.inner = {"ages": [0.0]}

    kept = Kept()
    before = entries(kept)
    kept.inner["ages"] += [1.0] * SAMPLES
    assert entries(kept) - before == SAMPLES


@pytest.mark.judge
@pytest.mark.timeout(60.0 * (SOAK_MIN + 10.0))
def test_no_process_grows_over_a_long_drive(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Of 5 min in which it settles, and 10 over which growth can be told, nothing is shorter."""
    whole_s = 60.0 * SOAK_MIN
    monkeypatch.setenv(SPELL_S, f"0,{whole_s / 6.0}")
    map_file, route_file = write_circuit(tmp_path, laps=math.ceil(whole_s / LAP_S))
    out = tmp_path / "runs"
    arguments = ("--map", str(map_file), "--route", str(route_file), "--end", f"{whole_s:.0f}")
    two = ("--workers", "2", "--tuning", "report")
    with started(out, *arguments, *two, entry=("-c", WITH_A_BUSY_CAR)) as process:
        screen, _ = process.communicate(timeout=whole_s + 300.0)
    done = Finished(process.returncode, screen, run_folder(out))

    record = done.record()
    assert record["exit"] == "completed", done.screen
    telemetry = record["ledger"]["telemetry"]
    assert telemetry["published"] > 2.0 * CALM_HZ * whole_s, "the car was never busy"
    assert telemetry["recorded"] + telemetry["lost"] == telemetry["published"]
    assert set(record["memory"]) >= {"orchestrator", "recorder", "viewer", "mirror", "w0", "w1"}
    print(json.dumps({name: record[name] for name in ("memory", "processor", "ledger")}, indent=1))
    assert done.run is not None
    day_gb = sum(one.stat().st_size for one in done.run.rglob("*")) * 86_400.0 / whole_s / 1e9
    print(f"a day is {day_gb:.1f} GB, with a sixth of it at ten times the samples")
    assert day_gb < DAY_GB
    grown = {name: held["per_hour"] for name, held in record["memory"].items()}
    assert None not in grown.values(), f"too short: FORETWIN_SOAK_MIN is {SOAK_MIN:g}"
    view = record["memory"]["viewer"]
    assert view["at_end"] - view["settled"] < VIEW_PART_MB
    del grown["viewer"]
    assert {name: by for name, by in grown.items() if by > MOST_MB_PER_H} == {}
