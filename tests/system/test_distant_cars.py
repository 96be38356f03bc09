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
from typing import NamedTuple

import numpy as np
import pyarrow.parquet as pq
import pytest

from foretwin.contracts.anchor import Anchor, AnchorPose
from foretwin.contracts.arrays import Array
from foretwin.contracts.campaign import role_files
from foretwin.contracts.frames import (
    GeoPoint,
    LocalFrame,
    geo_from_local,
    local_from_geo,
    local_from_geo_yaw,
)
from foretwin.contracts.setup import BusSetup, StandinSetup, write_setup
from foretwin.geometry.rectangles import clearance
from foretwin.orchestrator.campaign.issuing import issue
from foretwin.orchestrator.other_vehicles.encounters import NEAR_M
from foretwin.sim_worker.batch.collision_detection import ego_rectangles
from foretwin.sim_worker.vehicle.parameters import load_vehicle
from foretwin.telemetry.standin.source import START_STAMP_NS
from tests.chaos.link import PacketLink, own_network
from tests.orchestrator.campaign.campaigns import campaign, now
from tests.orchestrator.other_vehicles.test_far_apart import narrower
from tests.orchestrator.other_vehicles.two_cars import TRUTH_S
from tests.system.encounter_car import AHEAD_S, FROM, PATH, TRUTH
from tests.system.foretwin_command import environment, run_folder, wait_for

COVERS = ("foretwin.telemetry.standin.__main__",)

PORT = 7447
CAR = load_vehicle(None)
WORLD = LocalFrame(GeoPoint(45.0015, -30.002))
"""Where they meet: beside the streets of the drawn town."""
RADIUS_M, LAP_S, LAPS = 16.0, 22.0, 11
APART_M = math.sqrt(2.0) * RADIUS_M
"""Between the middles of two circles that cross at right angles."""
LATE_S = 0.8, 2.2
"""Nobody touches who comes (length + width) / speed = 1.3 s before or after the other."""
SETTLED_S, WITHIN_M = 8.0, 0.2
DELAY_S, LOSS = 0.08, 0.05
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
MIDDLES_M = {"ego": 0.0, "second": APART_M, "third": -APART_M}
FIRST_TURN = {"second": 170.0 / 360.0, "third": 350.0 / 360.0}
"""Turns until the first meeting."""


def path_of(name: str, random: np.random.Generator) -> dict[str, list[float]]:
    """A circle, again and again; who meets the car comes to the crossing somewhat late or early."""
    length_m = 2.0 * math.pi * RADIUS_M
    along_m = np.arange(0.0, (LAPS + 1.0) * length_m, 0.5)
    turns = along_m / length_m
    begins_rad = math.radians(235.0 if name == "ego" else 325.0)
    angle = begins_rad + math.tau * turns
    xy_m = RADIUS_M * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    lat, lon = geo_from_local(WORLD, xy_m + np.array([MIDDLES_M[name], 0.0])).T
    speed = np.full(len(turns), length_m / LAP_S)
    if name != "ego":
        late_s = random.choice((-1.0, 1.0), LAPS + 3) * random.uniform(*LATE_S, LAPS + 3)
        lap = np.maximum(np.ceil(turns - FIRST_TURN[name]), 0).astype(int)
        first_s = LAP_S * FIRST_TURN[name]
        stretched = np.where(
            lap == 0, 1.0 + late_s[0] / first_s, 1.0 + np.diff(late_s)[lap - 1] / LAP_S
        )
        speed = speed / stretched
    return {"lat_deg": lat.tolist(), "lon_deg": lon.tolist(), "speed_mps": speed.tolist()}


class TrueMeeting(NamedTuple):
    """An encounter as it was."""

    other: str
    from_s: float
    least_m: float
    touched: bool
    clear: bool
    """Whether it was none of a hair's breadth."""


def poses(folder: Path, name: str, time_s: Array) -> Array:
    """Return (N, 3) true poses in the World at times since they set off."""
    told = json.loads((folder / f"{name}.json").read_text(encoding="utf-8"))
    lat, lon, yaw = (np.array(told[key]) for key in ("lat_deg", "lon_deg", "yaw_rad"))
    xy_m = local_from_geo(WORLD, lat, lon)
    yaw_rad = np.unwrap(local_from_geo_yaw(WORLD, yaw, lat, lon))
    columns = (*xy_m.T, yaw_rad)
    return np.stack([np.interp(time_s, told["since_s"], one) for one in columns], axis=1)


def truly(folder: Path, other: str, until_s: float) -> list[TrueMeeting]:
    """Return the encounters of the car with another as those see them who stand beside."""
    time_s = np.arange(SETTLED_S, until_s, TRUTH_S)
    own, theirs = poses(folder, "ego", time_s), poses(folder, other, time_s)
    apart = clearance(ego_rectangles(CAR, own), ego_rectangles(CAR, theirs))
    less = clearance(ego_rectangles(CAR, own), ego_rectangles(narrower(CAR, WITHIN_M), theirs))
    found, k = [], 0
    while (near := np.flatnonzero(apart[k:] < NEAR_M)).size:
        first = k + int(near[0])
        gone = np.flatnonzero(apart[first:] > 2.0 * NEAR_M)
        if not gone.size:
            break
        k = first + int(gone[0])
        least_m = float(apart[first:k].min())
        clear = least_m > WITHIN_M or float(less[first:k].min()) == 0.0
        if first:  # else it began before all had settled
            found.append(TrueMeeting(other, float(time_s[first]), least_m, least_m == 0.0, clear))
    return found


class Meeting:
    """The drive, its car and two that join it, each in a network of its own or beside one."""

    def __init__(self, folder: Path, stack: contextlib.ExitStack) -> None:
        self.folder, self._stack = folder, stack
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

    def set_off(self) -> None:
        """Let all drive from now on."""
        partial = self.folder / "from.partial"
        partial.write_text(repr(time.monotonic() + 0.5), encoding="utf-8")
        partial.rename(self.folder / "from")

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
        meeting.set_off()
        lasts_s = LAPS * LAP_S + SETTLED_S
        begun_s = time.monotonic()
        wait_for(lambda: time.monotonic() - begun_s > lasts_s, "laps", within_s=lasts_s + 30.0)
        for process in joined.values():
            process.send_signal(signal.SIGTERM)
        codes = [process.wait(timeout=30.0) for process in joined.values()]
        meeting.drive.send_signal(signal.SIGINT)
        meeting.drive.wait(timeout=60.0)
        run = meeting.run
        wait_for((tmp_path / "ego.json").exists, "the car's truth")
    assert run is not None
    check(tmp_path, run, lasts_s - 2.0)
    assert codes == [0, 0]


def check(folder: Path, run: Path, until_s: float) -> None:
    rows = pq.read_table(run / "results" / "encounters.parquet").to_pylist()
    clocks = json.loads((run / "run.json").read_text())["clocks_beside"]
    errors, wrong, touches = [], [], 0
    true = [one for name in ("second", "third") for one in truly(folder, name, until_s)]
    for one in true:
        stamp_ns = START_STAMP_NS + round(one.from_s * 1e9)
        (row,) = (
            row
            for row in rows
            if one.other in (row["one"], row["other"]) and abs(row["stamp_ns"] - stamp_ns) < 4e9
        )
        error_m = abs(row["least_m"] - one.least_m)
        print(one, f"least {row['least_m']:.3f} ± {row['uncertain_m']:.3f} m, {row['touched']}")
        errors.append(error_m)
        touches += one.touched
        if error_m > WITHIN_M or (one.clear and row["touched"] != one.touched):
            wrong.append((one, row))
    clear = sum(one.clear for one in true)
    print(
        f"{len(true)} encounters, {clear} of them clear, {touches} touches; worst "
        f"{max(errors):.3f} m; clocks {clocks}; loads {os.getloadavg()}"
    )
    assert len(true) >= 20
    assert not wrong
