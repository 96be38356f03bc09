"""`foretwin join` beside a drive: stand-in cars on lots far apart brake for one another; they leave
in order, and who is killed is told of."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest

from foretwin.contracts.bus import ZenohBus
from foretwin.contracts.frames import GeoPoint, LocalFrame, local_from_geo
from foretwin.contracts.joining import running_drive
from foretwin.contracts.local_bus import WATCH
from foretwin.contracts.mailbox import Mailbox
from foretwin.contracts.roles import OtherVehicles
from tests.starvation import kept_waiting
from tests.system.foretwin_command import (
    child_pids,
    environment,
    is_running,
    log_lines,
    orchestrator_pid,
    run_folder,
    started,
    wait_for,
)

COVERS = ("foretwin.telemetry.standin.__main__",)
CONFIG = """
[[vehicles]]
id = "ahead"
live = true
[[vehicles]]
id = "behind"
live = true
"""
LOT = """
[lot]
lat_deg = {lat}
lon_deg = 11.0
yaw_deg = 70.0
[world]
lat_deg = 45.0
lon_deg = -30.0
yaw_deg = 0.0
"""
FLAGS = ("--futures", "4", "--rate", "0.2", "--config", "drive.toml")
AHEAD_M, SLOW_MPS, FAST_MPS, QUICK_MPS = 120.0, 3.0, 10.0, 6.0

HINDERED_S = 5.0
"""Who does not run for long is not known to others any more, and they drive on."""


def way(run: Path, file: Path, *, from_m: float) -> list[str]:
    """Write the car's own way from some metres on, as the line of who drives before or behind."""
    path = json.loads((run / "processes" / "standin_path.json").read_text(encoding="utf-8"))
    lat, lon = np.array(path["lat_deg"]), np.array(path["lon_deg"])
    frame = LocalFrame(GeoPoint(lat[0], lon[0]))
    along_m = np.cumsum(np.hypot(*np.diff(local_from_geo(frame, lat, lon), axis=0).T))
    points = np.stack([lon, lat], axis=1)[1:][along_m >= from_m].tolist()
    line = {"type": "LineString", "coordinates": points}
    feature = {"type": "Feature", "properties": {}, "geometry": line}
    whole = {"type": "FeatureCollection", "features": [feature]}
    file.write_text(json.dumps(whole), encoding="utf-8")
    return ["--route", str(file)]


def join(folder: Path, name: str, *words: str) -> subprocess.Popen[str]:
    """Let a car join from a lot of its own."""
    lot = folder / f"{name}-lot.toml"
    lot.write_text(LOT.format(lat=47.0 + len(name)), encoding="utf-8")
    return subprocess.Popen(
        [sys.executable, "-P", "-m", "foretwin", "join", name, "--anchor", str(lot), *words,
         "--out", str(folder / "runs")],
        cwd=folder, env=environment(folder / "cache"), text=True, stderr=subprocess.PIPE,
    )  # fmt: skip


class Speeds:
    """How fast each car was, as the drive says while it goes on."""

    def __init__(self, run: Path, bus: ZenohBus) -> None:
        self._inbox = Mailbox(4096)
        bus.subscribe("state", self._inbox, vehicle="ego")
        bus.subscribe("other_vehicles", self._inbox, run=run.name)
        self.all: dict[str, list[float]] = {}

    def slowed(self, *names: str) -> bool:
        """Whether each of these was quick, and is hardly quicker now than the slowest."""
        while (item := self._inbox.take()) is not None:
            said = item.message()
            states = (
                [one.state for one in said.heard] if isinstance(said, OtherVehicles) else [said]
            )
            for state in states:
                self.all.setdefault(state.vehicle_id, []).append(state.speed_mps)
        known = [self.all.get(name, [0.0]) for name in names]
        return all(max(one) > QUICK_MPS and one[-1] < SLOW_MPS + 1.0 for one in known)


def child_of(command: subprocess.Popen[str]) -> int:
    """Return the process that speaks for the vehicle of a command."""
    found = subprocess.run(
        ["pgrep", "-P", str(command.pid)], capture_output=True, text=True, check=True
    )
    return int(found.stdout.split()[0])


def texts(run: Path) -> list[str]:
    return [line["text"].removeprefix("orchestrator: ") for line in log_lines(run)]


@pytest.mark.judge
@pytest.mark.timeout(280)
def test_cars_that_join_brake_for_one_another_and_leave(tmp_path: Path) -> None:
    (tmp_path / "drive.toml").write_text(CONFIG, encoding="utf-8")
    out = tmp_path / "runs"
    with started(out, *FLAGS) as drive:
        wait_for(lambda: (at := run_folder(out)) is not None and (at / "run.json").exists(), "it")
        run = run_folder(out)
        assert run is not None
        ahead = join(
            tmp_path, "ahead", *way(run, tmp_path / "a.geojson", from_m=AHEAD_M),
            "--speed", str(SLOW_MPS),
        )  # fmt: skip
        behind = join(
            tmp_path, "behind", *way(run, tmp_path / "b.geojson", from_m=0.0),
            "--speed", str(FAST_MPS),
        )  # fmt: skip
        try:
            for name in ("ahead", "behind"):
                wait_for(lambda one=name: f"{one} is heard" in texts(run), name)  # type: ignore[misc]
            mine = child_pids(run)
            chain = orchestrator_pid(run), mine["router"], mine["vehicle"], ahead.pid, behind.pid
            with ZenohBus(running_drive(run).bus(WATCH)) as bus, kept_waiting(*chain) as kept:
                speeds = Speeds(run, bus)
                begun_s = time.monotonic()
                wait_for(
                    lambda: speeds.slowed("ego", "behind") or time.monotonic() - begun_s > 60.0,
                    "both to brake", within_s=90.0,
                )  # fmt: skip
            if not speeds.slowed("ego", "behind"):
                assert kept.seconds > HINDERED_S, "they did not brake, though they could run"
                pytest.skip(f"the machine kept somebody waiting for {kept.seconds:.1f} s")
            twice = join(tmp_path, "ahead")
            _, said = twice.communicate(timeout=60.0)
            assert (twice.returncode, said) == (
                2, "foretwin: ahead has joined already, from somewhere else\n",
            )  # fmt: skip
            child = child_of(behind)
            behind.kill()
            wait_for(lambda: any("behind is silent" in one for one in texts(run)), "silence")
            wait_for(lambda: not is_running(child), "the killed one's process")
            ahead.send_signal(signal.SIGTERM)
            _, said = ahead.communicate(timeout=30.0)
            assert ahead.returncode == 0, said
            wait_for(lambda: "ahead has left" in texts(run), "the leave")
        finally:
            for one in (ahead, behind):
                one.kill()
                one.communicate()
        drive.send_signal(signal.SIGINT)
        drive.communicate(timeout=60.0)
    rows = pq.read_table(run / "results" / "encounters.parquet").to_pylist()
    assert texts(run).count("behind is silent: gone until it is heard again") == 1
    nearest = {frozenset((row["one"], row["other"])): row["least_m"] for row in rows}
    print(
        nearest,
        f"kept waiting {kept.seconds:.1f} s",
        {name: (max(one), one[-1]) for name, one in speeds.all.items()},
    )
    if kept.seconds > HINDERED_S and any(row["touched"] for row in rows):
        pytest.skip(f"the machine kept somebody waiting for {kept.seconds:.1f} s")
    for pair in ({"ego", "ahead"}, {"ego", "behind"}):
        assert 0.5 < nearest[frozenset(pair)] < 8.0
    assert not any(row["touched"] for row in rows)
