"""Three stand-in cars on lots far apart meet in one World, in processes of their own over TLS: each
has its clock, the links have 80 ms and lose 5 % of the packets both ways.

`python -m tests.system.distant_cars [--encounters 100] [--pace 0.4] [--seed 0]` lets them meet so
often, in drives of some laps each, and holds the drives' verdicts against where the cars truly
were; exit code 0 where all are right. All happens in slow motion, delays of the links too: at the
pace of 0.4 a machine has two and a half times what it has, by the drive's time. `--seed` is of the
first drive; the following ones have the next.
"""

from __future__ import annotations

import argparse
import contextlib
import datetime
import json
import math
import os
import signal
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pyarrow.parquet as pq

from foretwin.contracts.anchor import Anchor, AnchorPose
from foretwin.contracts.anchor_file import AnchorFile, anchor_text
from foretwin.contracts.campaign import role_files
from foretwin.contracts.setup import BusSetup, StandinSetup, write_setup
from foretwin.orchestrator.campaign.issuing import issue
from foretwin.telemetry.standin.source import START_STAMP_NS
from tests.chaos.link import PacketLink, own_network
from tests.orchestrator.campaign.campaigns import campaign, now
from tests.system.encounter_car import AHEAD_S, FROM, PATH, THERE, TRUTH
from tests.system.foretwin_command import (
    end_process,
    environment,
    run_folder,
    slow_s,
    wait_for,
)
from tests.system.true_meetings import (
    LAP_S,
    SETTLED_S,
    WITHIN_M,
    WORLD,
    TrueMeeting,
    path_of,
    truly,
)

PORT = 7447
DELAY_S, LOSS = 0.08, 0.05
PACE, LAPS = 0.4, 11
WORSE_FIRST_S = 3.0
OTHERS = "second", "third"
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

    def __init__(
        self, folder: Path, stack: contextlib.ExitStack, *, seed: int, laps: int, pace: float
    ) -> None:
        """Raises OSError or subprocess.CalledProcessError where there are no networks to be had."""
        self.folder, self._stack, self._pace = folder, stack, pace
        drive, car, far = (stack.enter_context(own_network()) for _ in range(3))
        name = f"fd{os.getpid() % 10_000}"
        self._links = {
            "ego": PacketLink(car, f"{name}c", seed=2 * seed, near=drive),
            "second": PacketLink(far, f"{name}j", seed=2 * seed + 1, near=drive),
        }
        self._links["third"] = self._links["second"]
        for one in (self._links["ego"], self._links["second"]):
            stack.callback(one.close)
        subprocess.run(
            ["nsenter", "-t", str(car), "-n", "ip", "route", "add", "default", "dev", f"{name}cb"],
            check=True,
        )
        host = self._links["second"].host
        self.endpoint = f"tls/{host}:{PORT}"
        self.campaign = campaign(folder / "campaign", age_days=0.5)
        begun = now() - datetime.timedelta(days=0.5)
        issue(self.campaign, "router", days=2, now=begun, hosts=(host,))
        (folder / "config.toml").write_text(CONFIG, encoding="utf-8")
        random = np.random.default_rng(seed)
        for one in LOTS:
            file = folder / f"{one}-path.json"
            file.write_text(json.dumps(path_of(one, random, laps=laps)), encoding="utf-8")
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

    def worsen(self) -> None:
        """Let the links delay and lose what they carry.

        All have connected by then: a handshake's limit goes by the world's clock. What was asked
        about clocks before does not count, since those of the cars stand until they set off.
        """
        for one in set(self._links.values()):
            one.delay_s, one.loss = DELAY_S / self._pace, LOSS

    def set_off(self) -> float:
        """Let all drive from an instant on, and return it."""
        at_s = slow_s(self._pace) + 0.5
        partial = self.folder / "from.partial"
        partial.write_text(repr(at_s), encoding="utf-8")
        partial.rename(self.folder / "from")
        return at_s

    def _started(self, name: str, prefix: tuple[str, ...], *words: str) -> subprocess.Popen[bytes]:
        mine = {
            AHEAD_S: str(AHEAD.get(name, 0.0)), FROM: str(self.folder / "from"),
            TRUTH: str(self.folder), PATH: str(self.folder / f"{name}-path.json"),
        }  # fmt: skip
        with (self.folder / f"{name}.screen").open("ab") as screen:
            process = subprocess.Popen(
                [*prefix, sys.executable, "-P", "-m", *words], cwd=self.folder,
                env=environment(self.folder / "cache", pace=self._pace) | mine,
                stdout=screen, stderr=screen, stdin=subprocess.DEVNULL,
            )  # fmt: skip
        self._stack.callback(end_process, process)
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
    return anchor_text(AnchorFile(lot=anchor.lot, world=anchor.world))


class Told(NamedTuple):
    """An encounter as the drive's table holds it."""

    least_m: float
    touched: bool


class Judged(NamedTuple):
    """An encounter as it was, and what the drive told of it: one row where all is well."""

    truth: TrueMeeting
    told: tuple[Told, ...]

    @property
    def error_m(self) -> float:
        """Of the least distance; infinite where the drive told of none, or of several."""
        return abs(self.told[0].least_m - self.truth.least_m) if len(self.told) == 1 else math.inf

    @property
    def verdict(self) -> bool:
        """Whether it found rightly who touched whom."""
        return len(self.told) == 1 and self.told[0].touched == self.truth.touched

    @property
    def right(self) -> bool:
        """Within 0.2 m, and with the same verdict unless it was a hair's breadth."""
        return self.error_m <= WITHIN_M and (self.verdict or not self.truth.clear)


def met(folder: Path, *, seed: int, laps: int, pace: float = PACE) -> list[Judged]:
    """Let the cars drive so many laps, and return how each encounter was judged."""
    with contextlib.ExitStack() as stack:
        meeting = Meeting(folder, stack, seed=seed, laps=laps, pace=pace)
        meeting.car()
        joined = {name: meeting.join(name) for name in OTHERS}
        for name in ("ego", *joined):
            wait_for((folder / f"{name}{THERE}").exists, name, within_s=120.0)
        meeting.worsen()
        worse_s = slow_s(pace)
        wait_for(lambda: slow_s(pace) > worse_s + WORSE_FIRST_S, "questions", within_s=math.inf)
        until_s = meeting.set_off() + laps * LAP_S + SETTLED_S
        wait_for(lambda: slow_s(pace) > until_s, "laps", within_s=math.inf)
        for process in joined.values():
            process.send_signal(signal.SIGTERM)
        for name, process in joined.items():
            assert process.wait(timeout=60.0) == 0, meeting.said(name)
        meeting.drive.send_signal(signal.SIGINT)
        meeting.drive.wait(timeout=120.0)
        wait_for((folder / "ego.json").exists, "the car's truth")
        assert meeting.run is not None
        return judged(folder, meeting.run, laps * LAP_S + SETTLED_S - 2.0)


def judged(folder: Path, run: Path, until_s: float) -> list[Judged]:
    """Hold a drive's verdicts against the truth."""
    rows = pq.read_table(run / "results" / "encounters.parquet").to_pylist()
    found = []
    for one in [one for name in OTHERS for one in truly(folder, name, until_s)]:
        stamp_ns = START_STAMP_NS + round(one.from_s * 1e9)
        about_then = tuple(
            Told(row["least_m"], row["touched"])
            for row in rows
            if one.other in (row["one"], row["other"]) and abs(row["stamp_ns"] - stamp_ns) < 4e9
        )
        found.append(Judged(one, about_then))
    clocks = json.loads((run / "run.json").read_text(encoding="utf-8"))["clocks_beside"]
    print(f"clocks {clocks}; loads {os.getloadavg()}", flush=True)
    return found


def summary(found: Sequence[Judged]) -> str:
    """Return what came of so many encounters, in words."""
    hair = [one for one in found if not one.truth.clear]
    return (
        f"{sum(one.right for one in found)} of {len(found)} encounters judged as if co-located; "
        f"{sum(one.truth.touched for one in found)} are touches, of {len(hair)} by a hair's "
        f"breadth {sum(not one.verdict for one in hair)} were judged otherwise; least distances "
        f"at worst {max((one.error_m for one in found), default=0.0):.3f} m off"
    )


def main(arguments: Sequence[str]) -> int:
    """Let them meet, and print what came of it."""
    parser = argparse.ArgumentParser(prog="python -m tests.system.distant_cars")
    parser.add_argument("--encounters", type=int, default=100)
    parser.add_argument("--pace", type=float, default=PACE)
    parser.add_argument("--seed", type=int, default=0)
    asked = parser.parse_args(arguments)
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(1))  # by way of what ends the processes
    found: list[Judged] = []
    seed = asked.seed
    while len(found) < asked.encounters:
        with tempfile.TemporaryDirectory() as folder:
            drive = met(Path(folder), seed=seed, laps=LAPS, pace=asked.pace)
        for one in drive:
            print(f"seed {seed}: {one}", flush=True)
        found += drive
        seed += 1
        print(summary(found), flush=True)
    return 0 if all(one.right for one in found) else 1


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
