"""Replay and stand-in as processes of their own, over a real router."""

from __future__ import annotations

import contextlib
import datetime
import json
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest

from foretwin.contracts.bus import Mailbox, Received, ZenohBus, ask
from foretwin.contracts.drive import AdvanceRequest, DriveEnd, InfoRequest
from foretwin.contracts.keys import TELEMETRY_CHANNELS, alive_key
from foretwin.contracts.ports import free_endpoint
from foretwin.contracts.setup import BusSetup, ProcessSetup, ReplaySetup, StandinSetup, write_setup
from foretwin.contracts.simulation import RunEnd
from tests.contracts.bus_sides import DEADLINE_S
from tests.starvation import kept_waiting
from tests.telemetry.standin_drive import wished_path

COVERS = ("foretwin.telemetry.standin.__main__",)

ROOT = Path(__file__).resolve().parents[2]


class Ground(NamedTuple):
    """A router, what arrives there, and where files go."""

    bus: ZenohBus
    setup: BusSetup
    inbox: Mailbox
    folder: Path

    def base(self, **fields: object) -> dict[str, object]:
        return {
            "run_id": "r",
            "process_id": "vehicle",
            "vehicle_id": "car",
            "bus": self.setup,
            "log_file": str(self.folder / "vehicle.log"),
        } | fields

    def until_end(self) -> tuple[list[Received], DriveEnd]:
        """Return all samples that were published; what the end says may overtake the last ones:
        each channel lands by a thread of its own."""
        samples: list[Received] = []
        end: DriveEnd | None = None
        deadline = time.monotonic() + DEADLINE_S
        while end is None or len(samples) < sum(end.published.values()):
            item = self.inbox.take(1.0)
            assert time.monotonic() < deadline, f"{len(samples)} samples, then {end}"
            if item is not None and item.channel == "end":
                end = item.message()
            elif item is not None:
                samples.append(item)
        return samples, end

    def wait_alive(self) -> None:
        seen = Mailbox(4)
        self.bus.watch_alive(alive_key(run="r", process="vehicle"), seen)
        assert seen.take(DEADLINE_S) is not None, "the vehicle's process does not appear"

    def ready(self) -> None:
        self.bus.declare_alive(alive_key(run="r", process="orchestrator"))


@pytest.fixture
def ground(tmp_path: Path) -> Iterator[Ground]:
    setup = BusSetup(endpoint=free_endpoint(), lossless=True)
    with ZenohBus(setup, router=True) as bus:
        inbox = Mailbox(100_000)
        for channel in TELEMETRY_CHANNELS:
            bus.subscribe(channel, inbox, vehicle="car")
        yield Ground(bus, setup, inbox, tmp_path)


@contextlib.contextmanager
def running(module: str, setup: ProcessSetup, folder: Path) -> Iterator[subprocess.Popen[str]]:
    file = folder / "setup.json"
    write_setup(setup, file)
    command = [sys.executable, "-m", module, "--setup", str(file)]
    with subprocess.Popen(command, cwd=ROOT, stderr=subprocess.PIPE, text=True) as process:
        try:
            yield process
        finally:
            process.kill()


def gpx(folder: Path, *, seconds: int) -> Path:
    """Write 5 positions a second of a straight drive."""
    start = datetime.datetime(2026, 1, 1, tzinfo=datetime.UTC)
    points = "".join(
        f'<trkpt lat="{52.5 + k * 1e-5:.7f}" lon="13.4"><time>'
        f"{(start + datetime.timedelta(seconds=k / 5)).isoformat()}</time></trkpt>"
        for k in range(5 * seconds + 1)
    )
    file = folder / "drive.gpx"
    file.write_text(
        '<gpx xmlns="http://www.topografix.com/GPX/1/1" version="1.1"><trk><trkseg>'
        f"{points}</trkseg></trk></gpx>"
    )
    return file


def test_a_recorded_drive_runs_at_its_speed_and_leaves_at_the_end_of_the_run(
    ground: Ground,
) -> None:
    log = gpx(ground.folder, seconds=20)
    setup = ReplaySetup(**ground.base(log=str(log), start_s=2.0, speed=20.0))
    with running("foretwin.telemetry.processes.replay", setup, ground.folder) as process:
        ground.wait_alive()
        process.send_signal(signal.SIGINT)
        assert ground.inbox.take(0.3) is None
        ready_s = time.monotonic()
        with kept_waiting(process.pid) as kept:
            ground.ready()
            samples, end = ground.until_end()
        assert end.published == {"gnss": len(samples)} == {"gnss": 91}
        # Never early, not one of them; how late depends on who else uses the machine.
        received_s = np.array([sample.received_mono_ns for sample in samples]) * 1e-9
        assert (received_s - ready_s >= 0.2 / 20.0 * np.arange(91)).all()
        assert received_s[-1] - received_s[0] - kept.seconds < 18.0 / 2.0
        assert [sample.envelope().seq for sample in samples] == list(range(91))
        info = ask(ground.bus, "info", InfoRequest(), timeout_s=DEADLINE_S, vehicle="car")
        assert samples[0].message().stamp_ns - info.start_stamp_ns == 2_000_000_000
        ground.bus.publish("run_end", RunEnd(stamp_ns=0), run="r")
        assert process.wait(DEADLINE_S) == 0


def test_the_stand_in_in_lock_step_tells_what_it_has_published(ground: Ground) -> None:
    wish = wished_path()
    path_file = ground.folder / "path.json"
    path_file.write_text(
        json.dumps({name: values.tolist() for name, values in wish._asdict().items()})
    )
    setup = StandinSetup(**ground.base(path_file=str(path_file), end_s=1.0, speed=None))
    with running("foretwin.telemetry.standin", setup, ground.folder) as process:
        ground.wait_alive()
        ground.ready()
        info = ask(ground.bus, "info", InfoRequest(), timeout_s=DEADLINE_S, vehicle="car")
        ended = False
        for tenth in range(1, 12):
            question = AdvanceRequest(until_stamp_ns=info.start_stamp_ns + tenth * 100_000_000)
            reply = ask(ground.bus, "advance", question, timeout_s=DEADLINE_S, vehicle="car")
            ended = reply.ended
        assert ended
        samples, end = ground.until_end()
        assert end.published == reply.published
        assert sum(end.published.values()) == len(samples)
        assert end.published["imu"] == 101
        assert set(end.published) == set(info.sends)
        process.send_signal(signal.SIGTERM)
        assert process.wait(DEADLINE_S) == 0


@pytest.mark.parametrize(
    ("module", "fields"),
    [
        ("foretwin.telemetry.processes.replay", {"log": "nowhere.gpx"}),
        ("foretwin.telemetry.standin", {"path_file": "no.json"}),
    ],
)
def test_a_missing_file_is_one_line_and_exit_2(
    ground: Ground, module: str, fields: dict[str, str]
) -> None:
    kind = ReplaySetup if module == "foretwin.telemetry.processes.replay" else StandinSetup
    with running(module, kind(**ground.base(**fields)), ground.folder) as process:
        _, errors = process.communicate(timeout=DEADLINE_S)
        assert process.returncode == 2
        assert next(iter(fields.values())) in errors
        assert errors.count("\n") == 1
