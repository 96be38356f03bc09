"""Three stand-in cars on lots far apart meet in one World, in processes of their own over TLS: each
has its clock, the links have 80 ms and lose 5 % of the packets both ways."""

from __future__ import annotations

import contextlib
import json
import math
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest

from foretwin.contracts.anchor import Anchor, AnchorPose
from foretwin.contracts.arrays import Array
from foretwin.contracts.campaign import role_files
from foretwin.contracts.setup import BusSetup, StandinSetup, write_setup
from foretwin.orchestrator.campaign.issuing import issue
from foretwin.telemetry.standin.source import START_STAMP_NS
from tests.chaos.link import PacketLink, own_network
from tests.orchestrator.campaign.campaigns import campaign, now
from tests.starvation import kept_waiting
from tests.system.encounter_car import AHEAD_S, FROM, PATH, TRUTH
from tests.system.foretwin_command import (
    child_pids,
    environment,
    orchestrator_pid,
    run_folder,
    wait_for,
)
from tests.system.true_meetings import (
    LAP_S,
    LAPS,
    SETTLED_S,
    WITHIN_M,
    WORLD,
    path_of,
    truly,
)

COVERS = ("foretwin.telemetry.standin.__main__",)

PORT = 7447
DELAY_S, LOSS = 0.08, 0.05
HINDERED_S, AROUND_S = 15.0, (-3.0, 6.0)
"""So long all processes of the chain together, from before an encounter on: then states come too
late to be waited for. Chosen: nine processes on two cores wait for some seconds as it is."""
CONFIG = """
source = "live"
map_aiding = "off"
progress_table = "off"
futures = 1
rate_hz = 0.1
workers = 1
[[vehicles]]
id = "second"
live = true
[[vehicles]]
id = "third"
live = true
"""
LOTS = {"ego": (48.1, 11.6, 30.0), "second": (51.0, 13.8, -110.0), "third": (47.4, 8.5, 75.0)}
AHEAD = {"ego": 0.0, "second": 1.0, "third": -1.0}


class Meeting:
    """The drive, its car and two that join it, each in a network of its own or beside one."""

    def __init__(self, folder: Path, stack: contextlib.ExitStack) -> None:
        self.folder, self._stack = folder, stack
        self._processes: dict[str, subprocess.Popen[bytes]] = {}
        drive, car, far = (stack.enter_context(own_network()) for _ in range(3))
        name = f"fd{os.getpid() % 10_000}"
        self._links = {
            "ego": PacketLink(car, f"{name}c", seed=1, near=drive),
            "second": PacketLink(far, f"{name}j", seed=2, near=drive),
        }
        self._links["third"] = self._links["second"]
        for one in (self._links["ego"], self._links["second"]):
            stack.callback(one.close)
            one.delay_s, one.loss = DELAY_S, LOSS
        subprocess.run(
            ["nsenter", "-t", str(car), "-n", "ip", "route", "add", "default", "dev", f"{name}cb"],
            check=True,
        )
        host = self._links["second"].host
        self.endpoint = f"tls/{host}:{PORT}"
        self.campaign = campaign(folder / "campaign")
        issue(self.campaign, "router", days=2, now=now(), hosts=(host,))
        (folder / "config.toml").write_text(CONFIG, encoding="utf-8")
        random = np.random.default_rng(19)
        for one in LOTS:
            file = folder / f"{one}-path.json"
            file.write_text(json.dumps(path_of(one, random)), encoding="utf-8")
            (folder / f"{one}-lot.toml").write_text(lot_file(one), encoding="utf-8")
        prefix = ("nsenter", "-t", str(drive), "-n")
        self.drive = self._started(
            "drive", prefix, "foretwin", "drive", "--config", "config.toml", "--view", "none",
            "--tuning", "off", "--out", "runs", "--secure", "campaign", "--endpoint", self.endpoint,
        )  # fmt: skip
        wait_for(lambda: (at := self.run) is not None and (at / "run.json").exists(), "the drive")

    @property
    def run(self) -> Path | None:
        return run_folder(self.folder / "runs")

    def said(self, name: str) -> str:
        return (self.folder / f"{name}.screen").read_text(encoding="utf-8")

    def car(self) -> None:
        """Start the drive's own car."""
        assert self.run is not None
        setup = StandinSetup(
            run_id=self.run.name, process_id="car-of-ego", vehicle_id="ego",
            bus=BusSetup(endpoint=self.endpoint, tls=role_files(self.campaign, "car")),
            log_file=str(self.folder / "car.jsonl"), path_file=str(self.folder / "ego-path.json"),
            anchor=anchor_of("ego"),
        )  # fmt: skip
        file = self.folder / "ego-setup.json"
        write_setup(setup, file)
        prefix = self._links["ego"].prefix
        self._started("ego", prefix, "tests.system.encounter_car", "--setup", str(file))

    def join(self, name: str) -> subprocess.Popen[bytes]:
        """Let another join."""
        return self._started(
            name, self._links[name].prefix, "tests.system.encounter_car", "join", name,
            "--anchor", f"{name}-lot.toml", "--connect", self.endpoint, "--secure", "campaign/car",
        )  # fmt: skip

    def set_off(self) -> float:
        """Let all drive from an instant on, and return it."""
        at_s = time.monotonic() + 0.5
        partial = self.folder / "from.partial"
        partial.write_text(repr(at_s), encoding="utf-8")
        partial.rename(self.folder / "from")
        return at_s

    def cars(self) -> list[int]:
        """Return the processes of those that speak for vehicles, and what started them."""
        return [process.pid for name, process in self._processes.items() if name != "drive"]

    def _started(self, name: str, prefix: tuple[str, ...], *words: str) -> subprocess.Popen[bytes]:
        mine = {
            AHEAD_S: str(AHEAD.get(name, 0.0)), FROM: str(self.folder / "from"),
            TRUTH: str(self.folder), PATH: str(self.folder / f"{name}-path.json"),
        }  # fmt: skip
        with (self.folder / f"{name}.screen").open("ab") as screen:
            process = subprocess.Popen(
                [*prefix, sys.executable, "-P", "-m", *words], cwd=self.folder,
                env=environment(self.folder / "cache") | mine,
                stdout=screen, stderr=screen, stdin=subprocess.DEVNULL,
            )  # fmt: skip
        self._stack.callback(_ended, process)
        self._processes[name] = process
        return process


def anchor_of(name: str) -> Anchor:
    lat_deg, lon_deg, yaw_deg = LOTS[name]
    at = WORLD.origin
    return Anchor(
        lot=AnchorPose(lat_deg=lat_deg, lon_deg=lon_deg, yaw_deg=yaw_deg),
        world=AnchorPose(lat_deg=at.lat_deg, lon_deg=at.lon_deg, yaw_deg=0.0),
    )


def lot_file(name: str) -> str:
    anchor = anchor_of(name)
    return "".join(
        f"[{table}]\nlat_deg = {one.lat_deg}\nlon_deg = {one.lon_deg}\nyaw_deg = {one.yaw_deg}\n"
        for table, one in (("lot", anchor.lot), ("world", anchor.world))
    )


def _ended(process: subprocess.Popen[bytes]) -> None:
    if process.poll() is None:
        process.send_signal(signal.SIGTERM)
        try:
            process.wait(timeout=40.0)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()


@pytest.mark.judge
@pytest.mark.timeout(580)
def test_cars_on_lots_far_apart_are_judged_as_if_co_located(tmp_path: Path) -> None:
    with contextlib.ExitStack() as stack:
        try:
            meeting = Meeting(tmp_path, stack)
        except (OSError, subprocess.CalledProcessError) as error:
            pytest.skip(f"no networks of their own here: {error}")
        meeting.car()
        joined = {name: meeting.join(name) for name in ("second", "third")}
        for name in joined:
            wait_for(lambda one=name: "joins run" in meeting.said(one), name, within_s=60.0)  # type: ignore[misc]
        set_off_s = meeting.set_off()
        lasts_s = LAPS * LAP_S + SETTLED_S
        run = meeting.run
        assert run is not None
        chain = (orchestrator_pid(run), child_pids(run)["router"], *meeting.cars())
        busy = []
        with kept_waiting(*chain) as kept:

            def over() -> bool:
                busy.append((time.monotonic() - set_off_s, kept.seconds))
                return busy[-1][0] > lasts_s

            wait_for(over, "laps", within_s=lasts_s + 30.0)
        for process in joined.values():
            process.send_signal(signal.SIGTERM)
        codes = [process.wait(timeout=30.0) for process in joined.values()]
        meeting.drive.send_signal(signal.SIGINT)
        meeting.drive.wait(timeout=60.0)
        wait_for((tmp_path / "ego.json").exists, "the car's truth")
    check(tmp_path, run, lasts_s - 2.0, np.array(busy))
    assert codes == [0, 0]


def check(folder: Path, run: Path, until_s: float, busy: Array) -> None:
    """Hold the verdicts against the truth; `busy` (N, 2): since they set off, kept waiting."""
    rows = pq.read_table(run / "results" / "encounters.parquet").to_pylist()
    clocks = json.loads((run / "run.json").read_text())["clocks_beside"]
    right, wrong, hindered = [], [], []
    for one in [one for name in ("second", "third") for one in truly(folder, name, until_s)]:
        stamp_ns = START_STAMP_NS + round(one.from_s * 1e9)
        found = [
            row
            for row in rows
            if one.other in (row["one"], row["other"]) and abs(row["stamp_ns"] - stamp_ns) < 4e9
        ]
        around_s = one.from_s + np.array(AROUND_S)
        waited_s = float(np.diff(np.interp(around_s, *busy.T))[0])
        error_m = abs(found[0]["least_m"] - one.least_m) if len(found) == 1 else math.inf
        verdict = len(found) == 1 and found[0]["touched"] == one.touched
        fits = error_m <= WITHIN_M and (verdict or not one.clear)
        print(one, f"off by {error_m:.3f} m, verdict {verdict}, kept waiting {waited_s:.2f} s")
        (right if fits else hindered if waited_s > HINDERED_S else wrong).append((one, error_m))
    print(
        f"{len(right)} encounters judged right, {sum(one.touched for one, _ in right)} touches, "
        f"worst {max((error_m for _, error_m in right), default=0.0):.3f} m; "
        f"{len(wrong)} wrong, {len(hindered)} wrong while the machine kept somebody waiting for "
        f"over {HINDERED_S:g} s; clocks {clocks}; loads {os.getloadavg()}"
    )
    assert not wrong
    if len(hindered) > len(right):
        pytest.skip("the machine kept the drive from running most of the time")
