"""`python -m tests.benchmarks.live_limits [town berlin loaded crowd]` says whether live drives keep
their limits on two cores that do nothing else: each with its figure.

Nothing is traced: to measure spans takes processor time of its own. Berlin needs FORETWIN_DATA.
Exit code 1 where a limit does not hold, 2 for an unknown name.
"""

from __future__ import annotations

import math
import os
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import NamedTuple

from foretwin.contracts.drive import GnssFix, RoadUser, RoadUsers
from foretwin.contracts.frames import METRES_PER_DEG, GeoPoint
from foretwin.orchestrator.embedded import MAP_FILE
from foretwin.telemetry.logs.opening import open_log
from foretwin.telemetry.logs.write_mcap import create
from tests.benchmarks.live_drive import LiveDrive, drive_live

FUTURES, BUSY_LOOPS, CROWD = 64, 2, 500


class Limit(NamedTuple):
    """Something that a drive must keep, and what it kept."""

    text: str
    figure: float
    most: float = math.inf
    least: float = -math.inf

    @property
    def holds(self) -> bool:
        """Whether it does."""
        return self.least <= self.figure <= self.most

    def line(self) -> str:
        """Return it for people."""
        most = f" <= {self.most:g}" if self.most < math.inf else ""
        least = f" >= {self.least:g}" if self.least > -math.inf else ""
        found = "holds " if self.holds else "BROKEN"
        return f"{found if most + least else '      '} {self.text}: {self.figure:.3g}{most}{least}"


def quiet_limits(found: LiveDrive) -> list[Limit]:
    """Return the limits of a drive that has the machine to itself."""
    return [
        Limit("others use, cores (else nothing below counts)", found.others_cores, most=0.1),
        Limit("missed, % of rounds", 100.0 * found.missed / (found.rounds + found.missed), most=1),
        Limit("fewest futures in a round", found.least_futures, least=FUTURES),
        Limit("state to result p95, ms", found.p95_ms, most=250.0),
        Limit("orchestrator, % of a core", 100.0 * found.shares["orchestrator"], most=8.0),
        Limit("all processes, cores", sum(found.shares.values()), most=1.0),
    ]


def town() -> list[Limit]:
    """Drive through the drawn town."""
    with tempfile.TemporaryDirectory() as name:
        return quiet_limits(drive_live([], Path(name)))


def berlin() -> list[Limit]:
    """Replay a real drive."""
    data = Path(os.environ["FORETWIN_DATA"])
    log = data / "drive-berlin-gendarmenmarkt" / "Berlin_Gendarmenmarkt_GT.txt"
    where = ["--map", str(data / "osm-berlin-mitte" / "berlin-mitte.osm"), "--log", str(log)]
    with tempfile.TemporaryDirectory() as name:
        return quiet_limits(drive_live([*where, "--route", "from-log"], Path(name)))


def loaded() -> list[Limit]:
    """Drive through the town beside two busy loops."""
    with ExitStack() as stack:
        folder = Path(stack.enter_context(tempfile.TemporaryDirectory()))
        for _ in range(BUSY_LOOPS):
            loop = subprocess.Popen([sys.executable, "-c", "while True: pass"])
            stack.callback(loop.wait)
            stack.callback(loop.kill)
        found = drive_live([], folder)
    return [
        Limit("busy loops beside: others use, cores", found.others_cores, least=0.5),
        Limit("busy loops beside: fewest futures in a round", found.least_futures, least=32),
    ]


def crowd() -> list[Limit]:
    """Replay a drive through the town, with nobody and with 500 road users detected."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        recorded = folder / "recorded"
        recorded.mkdir()
        drive_live(["--futures", "8"], recorded)
        (log,) = (recorded / "runs").glob("*/drive.mcap")
        found = {}
        for count in (0, CROWD):
            with_crowd, out = folder / f"{count}.mcap", folder / str(count)
            out.mkdir()
            add_crowd(log, with_crowd, count)
            options = ["--map", str(MAP_FILE), "--log", str(with_crowd)]
            found[count] = drive_live(options, out)
    alone, among = found[0], found[CROWD]
    jobs = among.jobs_cpu_ms / alone.jobs_cpu_ms
    return [
        Limit("crowd: state to result p95 against nobody", among.p95_ms / alone.p95_ms, most=1.3),
        Limit("crowd: processor time of a round's jobs against nobody", jobs),
        Limit(
            "crowd: processor time of all against nobody",
            sum(among.shares.values()) / sum(alone.shares.values()),
        ),
    ]


def add_crowd(log: Path, into: Path, count: int) -> None:
    """Write a drive again, with so many road users within 100 m of the car at each position."""
    read, written = open_log(log), create(into)
    written.set_info(read.info)
    for channel, message in read.samples():
        if channel in ("end", "objects", "state"):
            continue
        written.add(channel, message)
        if count and isinstance(message, GnssFix):
            users = tuple(_around(message.position, count))
            written.add("objects", RoadUsers(stamp_ns=message.stamp_ns, users=users))
    written.finish()


def _around(place: GeoPoint, count: int) -> Iterator[RoadUser]:
    per_lon = METRES_PER_DEG * math.cos(math.radians(place.lat_deg))
    for number in range(count):
        # A sunflower's seeds: evenly spread.
        away_m, angle = 100.0 * math.sqrt((number + 1) / count), 2.4 * number
        yield RoadUser(
            user_id=f"u{number}",
            kind="car",
            position=GeoPoint(
                place.lat_deg + away_m * math.sin(angle) / METRES_PER_DEG,
                place.lon_deg + away_m * math.cos(angle) / per_lon,
            ),
            yaw_rad=angle % math.tau - math.pi,
            speed_mps=5.0,
            length_m=4.5,
            width_m=1.8,
        )


DRIVES: dict[str, Callable[[], list[Limit]]] = {
    one.__name__: one for one in (town, berlin, loaded, crowd)
}


def main(names: list[str]) -> int:
    """Drive the named drives, all by default, and print each limit with its figure."""
    if unknown := [name for name in names if name not in DRIVES]:
        print(f"unknown drive {', '.join(unknown)}; known: {', '.join(DRIVES)}")
        return 2
    broken = 0
    for name in names or DRIVES:
        if name == "berlin" and "FORETWIN_DATA" not in os.environ:
            print("berlin: not measured: FORETWIN_DATA is not set")
            broken += 1
            continue
        print(f"{name}:", flush=True)
        for limit in DRIVES[name]():
            broken += not limit.holds
            print(f"  {limit.line()}", flush=True)
    return 1 if broken else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
