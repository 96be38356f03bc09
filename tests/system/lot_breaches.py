"""A car on a lot does wrong while it is shown things: its stack is told within 200 ms.

`python -m tests.system.lot_breaches [--breaches 20] [--pace 0.5] [--seed 0]` draws cases of all
kinds (`tests/system/breaches.py`) in both dialects and plays each in a drive of its own, since a
gate that has shut stays shut; exit code 0 where all held. Drive, car and stack are processes and
speak over Zenoh, in slow motion: all seconds are the drive's. Where a busy machine halts somebody
for 150 ms of them the gate shuts before anything is wrong, rightly, and the case is played anew,
slower.
"""

from __future__ import annotations

import argparse
import contextlib
import math
import re
import signal
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import msgspec

from foretwin.contracts.anchor import Anchor, AnchorPose
from foretwin.contracts.anchor_file import AnchorFile, anchor_text
from foretwin.contracts.bus import ZenohBus
from foretwin.contracts.frames import local_from_geo
from foretwin.contracts.ports import free_endpoint
from foretwin.contracts.setup import BusSetup
from tests.contracts.bus_sides import DEADLINE_S
from tests.system.breach_car import SEEN, Drove
from tests.system.breaches import HALTED, KINDS, Breach, drawn, lot_place
from tests.system.foretwin_command import (
    FRESH,
    child_pids,
    environment,
    log_lines,
    orchestrator_pid,
    run_folder,
    started,
    wait_for,
)
from tests.telemetry.lot_car.test_braking import ANCHOR, MAPPING

WITHIN_S, LISTS_EVERY_S = 0.200, 0.150
EARLY_S = 0.300
"""So much before the car is in the wrong by its way it may be so by what is known of it."""
PACE, SLOWER, ATTEMPTS = 0.5, 0.4, 4
"""How slow drives are at first, by what they are slower each time, and how often one is tried."""
TOWN = Anchor(
    lot=ANCHOR.lot, world=AnchorPose(lat_deg=44.9998199, lon_deg=-30.0050731, yaw_deg=3.0)
)
"""Where the drawn town begins."""
WALKER_M = 60.0, 70.0
"""Whom nobody brakes for: on the lot, well beside the way."""
KNOWN_SHARE = 0.95
"""Of the times that the car's perception says again whom it was shown; the last may be lost."""
_KNOWN = re.compile(r"road users that we have shown it': (\d+)")
AT_MOST_M = 1.0
"""So far from there the stack may be told of it."""
FLAGS = (
    "--source", "live", "--towards-vehicle", "--futures", "1", "--rate", "0.2", "--horizon", "1",
    "--workers", "1",
)  # fmt: skip
PERCEIVED = f"""
[[in]]
topic = "{SEEN}"
type = "autoware_perception_msgs/msg/PredictedObjects"
channel = "objects"
[[out]]"""


class Outcome(NamedTuple):
    """What came of a breach; times from when the car was in the wrong, by the drive."""

    stopped_s: float
    """The last list that told of somebody; negative where that was before."""
    empty_s: float
    """The one empty list, from the instant at which a halted gateway went on; else the same."""
    why: str
    """What the gateway said."""
    faults: tuple[str, ...]
    """What should not have been."""


class StarvedError(Exception):
    """The gate shut before anything was wrong."""


def judged(breach: Breach, drove: Drove, log: Sequence[str]) -> Outcome:
    """Return what came of a breach, by what the stack heard and the gateway said of it.

    Raises StarvedError where a busy machine has shut the gate before.
    """
    kind = KINDS[breach.kind]
    shut = [line for line in log if "towards the vehicle: shut" in line]
    full_ns = [one.wall_ns for one in drove.heard if one.at_m]
    if drove.wrong_ns is None or not full_ns:
        raise StarvedError("; ".join(shut) or "the gate never opened")
    stopped_s = (full_ns[-1] - drove.wrong_ns) * 1e-9
    as_expected = any(re.search(kind.why, line) for line in shut)
    shut_before = any(one.wall_ns < drove.wrong_ns for one in drove.heard if not one.at_m)
    known_before = kind.by_its_way and as_expected
    if stopped_s < -LISTS_EVERY_S - known_before * EARLY_S or (shut_before and not known_before):
        raise StarvedError("; ".join(shut))
    went_on_ns = drove.goes_on_ns if HALTED.get(breach.kind) == "gateway" else None
    empty_s = [
        (one.wall_ns - (went_on_ns or drove.wrong_ns)) * 1e-9 for one in drove.heard if not one.at_m
    ]
    most_s = WITHIN_S + kind.allowed_s
    walker, known = walker_m(), sum(int(n) for n in _KNOWN.findall("\n".join(log)))
    found = {
        "no line, or several, of a gate that shuts": len(shut) != 1,
        "shut for another reason": not as_expected,
        f"still told of somebody after {most_s:.1f} s": stopped_s >= most_s,
        "not one empty list": len(empty_s) != 1,
        "the empty list came late": max(empty_s, default=0.0) >= most_s,
        "no silence after the empty list": bool(drove.heard[-1].at_m),
        "told of somebody else than the one virtual pedestrian": any(
            len(one.at_m) > 1 or any(math.dist(at_m, walker) > AT_MOST_M for at_m in one.at_m)
            for one in drove.heard
        ),
    }
    found["whom it was shown came back as real"] = known < KNOWN_SHARE * drove.echoes
    faults = tuple(words for words, holds in found.items() if holds)
    return Outcome(stopped_s, max(empty_s, default=math.nan), "; ".join(shut), faults)


def walker_m() -> tuple[float, float]:
    """Return where the virtual pedestrian is on the lot, in metres of its [map]."""
    at, lot = lot_place(*WALKER_M), TOWN.lot
    x_m, y_m = local_from_geo(lot.frame, at.lat_deg, at.lon_deg).tolist()
    return x_m, y_m


def played(folder: Path, breach: Breach, *, pace: float) -> Outcome:
    """Play a breach in a drive of its own; see `judged`."""
    endpoint = free_endpoint()
    ros2, lot, case = folder / "car.toml", folder / "lot.toml", folder / "breach.json"
    there = TOWN.world_from_lot(lot_place(*WALKER_M), 0.0).position
    text = MAPPING.format(
        dialect=breach.dialect, objects=breach.lists, lat=there.lat_deg, lon=there.lon_deg
    ).replace("\n[[out]]", PERCEIVED, 1)
    ros2.write_text(f'endpoint = "{endpoint}"\n{text}', encoding="utf-8")
    file = AnchorFile(lot=TOWN.lot, world=TOWN.world, fence=breach.fence_deg)
    lot.write_text(anchor_text(file), encoding="utf-8")
    case.write_bytes(msgspec.json.encode(breach))
    flags = (*FLAGS, "--ros2", str(ros2), "--anchor", str(lot))
    with (
        ZenohBus(BusSetup(endpoint=endpoint), router=True),
        started(folder / "runs", *flags, entry=FRESH, pace=pace),
    ):
        wait_for(lambda: run_folder(folder / "runs") is not None, "the run's folder")
        run = run_folder(folder / "runs")
        assert run is not None
        wait_for(lambda: any("both switches are on" in one for one in said(run)), "the gateway")
        car = subprocess.Popen(
            [sys.executable, "-P", "-m", "tests.system.breach_car", str(ros2), str(case),
             str(_pid(run, breach))],
            stdout=subprocess.PIPE, text=True, env=environment(folder / "cache", pace=pace),
        )  # fmt: skip
        try:
            told, _ = car.communicate(timeout=DEADLINE_S + 70.0 / pace)
        finally:
            car.kill()
        drove = msgspec.json.decode(told, type=Drove)
        with contextlib.suppress(AssertionError):  # `judged` says what is lacking
            wait_for(
                lambda: any("vehicle: shut" in one for one in said(run)), "a line", within_s=5.0
            )
    return judged(breach, drove, said(run))


def said(run: Path) -> list[str]:
    return [one["text"] for one in log_lines(run)]


def _pid(run: Path, breach: Breach) -> int:
    if HALTED.get(breach.kind) == "orchestrator":
        return orchestrator_pid(run)
    return child_pids(run)["ros2"]


def held(folder: Path, breach: Breach, *, pace: float = PACE) -> tuple[Outcome, float]:
    """Play a breach, slower each time the machine is too busy; return the pace as well."""
    for attempt in range(ATTEMPTS):
        inside = folder / str(attempt)
        inside.mkdir()
        try:
            return played(inside, breach, pace=pace), pace
        except StarvedError as why:
            print(f"  {breach} at {pace:g}: shut too early: {why}", flush=True)
            pace *= SLOWER
    raise StarvedError(f"{breach}: in {ATTEMPTS} attempts the gate shut before anything was wrong")


def main(arguments: Sequence[str]) -> int:
    """Draw and play, and print what came of each."""
    parser = argparse.ArgumentParser(prog="python -m tests.system.lot_breaches")
    parser.add_argument("--breaches", type=int, default=20)
    parser.add_argument("--pace", type=float, default=PACE)
    parser.add_argument("--seed", type=int, default=0)
    asked = parser.parse_args(arguments)
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(1))  # by way of what ends the processes
    held_so_far, latest_s = 0, -math.inf
    for number, breach in enumerate(drawn(asked.breaches, seed=asked.seed), 1):
        with tempfile.TemporaryDirectory() as folder:
            outcome, pace = held(Path(folder), breach, pace=asked.pace)
        held_so_far += not outcome.faults
        latest_s = max(latest_s, outcome.stopped_s)
        print(
            f"{number}: {breach} at {pace:g}: last list {outcome.stopped_s * 1e3:.0f} ms "
            f"(of {(WITHIN_S + KINDS[breach.kind].allowed_s) * 1e3:.0f}), "
            f"empty after {outcome.empty_s * 1e3:.0f} ms; "
            f"{outcome.why}; {', '.join(outcome.faults) or 'held'}",
            flush=True,
        )
    print(f"{held_so_far} of {asked.breaches} held; the latest list after {latest_s * 1e3:.0f} ms")
    return 0 if held_so_far == asked.breaches else 1


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
