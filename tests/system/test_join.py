"""`foretwin join` beside a drive: stand-in cars on lots far apart brake for one another; they leave
in order, and who is killed is told of."""

from __future__ import annotations

import contextlib
import json
import math
import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest

from foretwin.contracts.bus import ZenohBus
from foretwin.contracts.drive import VehicleState
from foretwin.contracts.frames import GeoPoint, LocalFrame, local_from_geo
from foretwin.contracts.joining import running_drive
from foretwin.contracts.local_bus import WATCH
from foretwin.contracts.mailbox import Mailbox
from tests.system.foretwin_command import (
    FRESH,
    environment,
    is_running,
    log_lines,
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
CLEAR_M = 15.0
"""The drive's car is so far on as another sets off behind it."""

PACE = 0.2
"""Who does not run for half a second is not known to others any more, and they drive on: on two
cores that others use too that happens, by the drive's time it does not."""
BRAKES_WITHIN_S = 60.0
"""Of the drive's time."""


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


@contextlib.contextmanager
def join(folder: Path, name: str, *words: str) -> Iterator[subprocess.Popen[str]]:
    """Let a car join from a lot of its own; it is gone afterwards."""
    lot = folder / f"{name}-lot.toml"
    lot.write_text(LOT.format(lat=47.0 + len(name)), encoding="utf-8")
    process = subprocess.Popen(
        [sys.executable, "-P", "-m", "foretwin", "join", name, "--anchor", str(lot), *words,
         "--out", str(folder / "runs")],
        cwd=folder, env=environment(folder / "cache", pace=PACE), text=True, stderr=subprocess.PIPE,
    )  # fmt: skip
    try:
        yield process
    finally:
        process.kill()
        process.communicate()


class Speeds:
    """How fast each car was, and for how long, as the drive says while it goes on."""

    def __init__(self, run: Path, bus: ZenohBus) -> None:
        self._inbox = Mailbox(4096)
        bus.subscribe("state", self._inbox, vehicle="ego")
        bus.subscribe("other_vehicles", self._inbox, run=run.name)
        self.all: dict[str, list[float]] = {}
        self._stamps_ns: list[int] = []
        self._from: VehicleState | None = None
        self._at: VehicleState | None = None

    @property
    def way_m(self) -> float:
        """How far the drive's car has come from where it was first, straight there."""
        self._listen()
        if self._from is None or self._at is None:
            return 0.0
        here = self._at.position
        frame = LocalFrame(self._from.position)
        return float(np.hypot(*local_from_geo(frame, here.lat_deg, here.lon_deg)))

    @property
    def since_s(self) -> float:
        """For how long by the drive's time."""
        self._listen()
        return (self._stamps_ns[-1] - self._stamps_ns[0]) / 1e9 if self._stamps_ns else 0.0

    def slowed(self, *names: str) -> bool:
        """Whether each of these was quick, and is hardly quicker now than the slowest."""
        self._listen()
        known = [self.all.get(name, [0.0]) for name in names]
        return all(max(one) > QUICK_MPS and one[-1] < SLOW_MPS + 1.0 for one in known)

    def _listen(self) -> None:
        while (item := self._inbox.take()) is not None:
            said = item.message()
            self._stamps_ns.append(said.stamp_ns)
            if isinstance(said, VehicleState):
                self._from, self._at = self._from or said, said
            states = [said] if said is self._at else [one.state for one in said.heard]
            for state in states:
                self.all.setdefault(state.vehicle_id, []).append(state.speed_mps)


def child_of(command: subprocess.Popen[str]) -> int:
    """Return the process that speaks for the vehicle of a command."""
    found = subprocess.run(
        ["pgrep", "-P", str(command.pid)], capture_output=True, text=True, check=True
    )
    return int(found.stdout.split()[0])


def texts(run: Path) -> list[str]:
    return [line["text"].removeprefix("orchestrator: ") for line in log_lines(run)]


@pytest.mark.judge
@pytest.mark.timeout(580)
def test_cars_that_join_brake_for_one_another_and_leave(tmp_path: Path) -> None:
    (tmp_path / "drive.toml").write_text(CONFIG, encoding="utf-8")
    out = tmp_path / "runs"
    with started(out, *FLAGS, entry=FRESH, pace=PACE) as drive:
        wait_for(lambda: (at := run_folder(out)) is not None and (at / "run.json").exists(), "it")
        run = run_folder(out)
        assert run is not None
        with contextlib.ExitStack() as stack:
            speeds = Speeds(run, stack.enter_context(ZenohBus(running_drive(run).bus(WATCH))))
            ahead = stack.enter_context(join(
                tmp_path, "ahead", *way(run, tmp_path / "a.geojson", from_m=AHEAD_M),
                "--speed", str(SLOW_MPS),
            ))  # fmt: skip
            wait_for(lambda: speeds.way_m > CLEAR_M, "room behind it")
            behind = stack.enter_context(join(
                tmp_path, "behind", *way(run, tmp_path / "b.geojson", from_m=0.0),
                "--speed", str(FAST_MPS),
            ))  # fmt: skip
            for name in ("ahead", "behind"):
                wait_for(lambda one=name: f"{one} is heard" in texts(run), name)  # type: ignore[misc]
            wait_for(
                lambda: speeds.slowed("ego", "behind") or speeds.since_s > BRAKES_WITHIN_S,
                "both to brake", within_s=2.0 * BRAKES_WITHIN_S / PACE,
            )  # fmt: skip
            assert speeds.slowed("ego", "behind")
            with join(tmp_path, "ahead") as twice:
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
        drive.send_signal(signal.SIGINT)
        drive.communicate(timeout=60.0)
    rows = pq.read_table(run / "results" / "encounters.parquet").to_pylist()
    assert texts(run).count("behind is silent: gone until it is heard again") == 1
    nearest: dict[frozenset[str], float] = {}
    for row in rows:
        pair = frozenset((row["one"], row["other"]))
        nearest[pair] = min(row["least_m"], nearest.get(pair, math.inf))
    print(nearest, {name: (max(one), one[-1]) for name, one in speeds.all.items()})
    for other in ("ahead", "behind"):
        assert 0.5 < nearest[frozenset(("ego", other))] < 8.0
    assert not any(row["touched"] for row in rows)
