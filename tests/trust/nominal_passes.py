"""Passes on which the nominal future is measured: drives, or parts of them, with maps.

Each is driven in lock step with its route from the log, as `foretwin drive --route from-log` does
it, in this process (`in_process_drive`): what is measured is what is shipped. Where no public map
is at hand its road is drawn from the drive (`drawn_road`), 300 s at a time, so that streets that
are driven again do not lie in it twice.
"""

from __future__ import annotations

import argparse
import os
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Literal, NamedTuple

import numpy as np

from foretwin.contracts.frames import target_from_source_m
from foretwin.contracts.futures import RESULT_STEP_S
from foretwin.orchestrator.config import DriveConfig
from tests.orchestrator.in_process_drive import LockStep, Round
from tests.trust.drawn_road import draw_road
from tests.trust.drives import RealDrive, all_drives
from tests.trust.truth import Truth, truth_of

Group = Literal["given", "tuned_on", "held_out"]
HORIZON_S = 8.0
TIMES_S = RESULT_STEP_S * np.arange(1, round(HORIZON_S / RESULT_STEP_S) + 1)
WINDOW_S = 300.0
_LEAST_DRIVEN_M = 300.0
_LONGEST_GAP_S = 1.0


class Source(NamedTuple):
    """A drive, its file below its folder's variable, and the map that holds it, if there is one."""

    name: str
    group: Group
    variable: str
    log: str
    map: str | None = None
    windows_s: tuple[tuple[float, float], ...] = ()
    speed_limit_kmh: int = 50
    """Of a drawn road."""


SOURCES = (
    Source(
        "gendarmenmarkt",
        "given",
        "FORETWIN_DATA",
        "drive-berlin-gendarmenmarkt/Berlin_Gendarmenmarkt_GT.txt",
        "osm-berlin-mitte/berlin-mitte.osm",
        ((0.0, 262.7), (643.9, 696.1)),
    ),
    *(
        Source(name, "given", "FORETWIN_DATA", log)
        for name, log in (
            ("potsdamer-platz", "drive-berlin-potsdamer-platz/Berlin_Potsdamer_Platz_GT.txt"),
            ("westend", "drive-frankfurt-westend/Frankfurt_Westend_Tower_GT.txt"),
        )
    ),
    Source(
        "comma2k19", "given", "FORETWIN_DATA", "drive-comma2k19-sf/segment40", speed_limit_kmh=105
    ),
    Source("chemnitz", "tuned_on", "FORETWIN_DRIVES", "chemnitz-city/Chemnitz_GT.txt"),
    Source("boulder", "tuned_on", "FORETWIN_DRIVES", "boulder-rtk/boulder.csv"),
    *(
        Source(f"kitti-{number}", group, "FORETWIN_DRIVES", f"kitti-{number}/kitti{number}.csv")
        for group, numbers in (
            ("tuned_on", ("00", "05")),
            ("held_out", ("02", "06", "07", "08", "09", "10")),
        )
        for number in numbers
    ),
    Source(
        "main-tower",
        "held_out",
        "FORETWIN_DRIVES",
        "frankfurt-main-tower/Frankfurt_Main_Tower_GT.txt",
    ),
    Source("wuhan", "held_out", "FORETWIN_DRIVES", "wuhan-gins/wuhan.csv"),
    Source("austin-car", "held_out", "FORETWIN_DRIVES", "austin-bmw/austin_car_gps.csv"),
)


class Pass(NamedTuple):
    """A pass: its rounds with a known truth over the whole horizon, and what played them."""

    name: str
    group: Group
    drive: LockStep
    truth: Truth
    rounds: list[Round]
    from_s: float
    until_s: float
    """Since the first position."""

    def true_xy_m(self, one: Round, times_s: np.ndarray = TIMES_S) -> np.ndarray:
        """Where the car was (T, 2) at times after a round, in its World's frame."""
        stamps = one.state.stamp_ns + np.round(times_s * 1e9).astype(np.int64)
        xy = self.truth.at(stamps, "xy_m")
        return np.asarray(target_from_source_m(one.world.frame, self.truth.frame, xy))


def passes(
    names: list[str], groups: list[Group], folder: Path, *, driver: type[LockStep] = LockStep
) -> Iterator[Pass]:
    """Drive the passes of some groups, or by their names; drawn maps are written to `folder`."""
    drives = {drive.name: drive for drive in all_drives()}
    for source in SOURCES:
        wanted = source.name in names if names else source.group in groups
        if wanted and source.name in drives:
            yield from _passes_of(source, drives[source.name], folder, driver)


def asked_passes(
    command: str,
    arguments: list[str],
    *,
    usual: tuple[Group, ...] = ("given",),
    driver: type[LockStep] = LockStep,
) -> Iterator[Pass]:
    """Drive the passes that a command line asks for, [NAME ...] [--group GROUP], or the `usual`.

    Ends the program, before anything is driven, for words that are no such line of `command`.
    """
    parser = argparse.ArgumentParser(prog=f"python -m {command}")
    parser.add_argument("names", nargs="*")
    parser.add_argument("--group", action="append", default=[])
    given = parser.parse_args(arguments)
    return _asked(given.names, given.group or [*usual], driver)


def _asked(names: list[str], groups: list[Group], driver: type[LockStep]) -> Iterator[Pass]:
    with tempfile.TemporaryDirectory() as folder:
        yield from passes(names, groups, Path(folder), driver=driver)


def _passes_of(
    source: Source, drive: RealDrive, folder: Path, driver: type[LockStep]
) -> Iterator[Pass]:
    base, truth = Path(os.environ[source.variable]), truth_of(drive)
    log = str(base / source.log)
    if source.map is not None:
        driven = _driven(driver, str(base / source.map), log)
        for number, window in enumerate(source.windows_s, 1):
            yield _cut(f"{source.name} {number}", source.group, driven, truth, window)
        return
    since_s = (truth.track.stamp_ns - truth.track.stamp_ns[0]) * 1e-9
    for number in range(int(since_s[-1] // WINDOW_S) + 1):
        window = number * WINDOW_S, (number + 1) * WINDOW_S
        xy = truth.track.xy_m[(since_s >= window[0]) & (since_s < window[1])]
        if np.hypot(*np.diff(xy, axis=0).T).sum() < _LEAST_DRIVEN_M:
            continue
        map_file = draw_road(
            xy, truth.frame, folder / f"{source.name}-{number}.osm", seed=number,
            speed_limit_kmh=source.speed_limit_kmh,
        )  # fmt: skip
        driven = _driven(driver, str(map_file), log)
        yield _cut(f"{source.name} {number + 1}, drawn", source.group, driven, truth, window)


def _driven(driver: type[LockStep], map_file: str, log: str) -> LockStep:
    config = DriveConfig(
        map=map_file, log=log, route="from-log", speed=None, view="none", horizon_s=HORIZON_S,
        futures=1, futures_per_job=1, scenarios=(),
    )  # fmt: skip
    return driver(config, futures=False).run()


def _cut(
    name: str, group: Group, drive: LockStep, truth: Truth, window_s: tuple[float, float]
) -> Pass:
    """Keep the rounds of a window whose truth reaches to the horizon without a gap."""
    stamps = truth.track.stamp_ns
    long = np.flatnonzero(np.diff(stamps) > _LONGEST_GAP_S * 1e9)
    kept = []
    for one in drive.rounds:
        begin = one.state.stamp_ns
        at_s, end = (begin - stamps[0]) * 1e-9, begin + HORIZON_S * 1e9
        whole = at_s >= window_s[0] and at_s + HORIZON_S < window_s[1] and end < stamps[-1]
        if whole and not np.any((stamps[long + 1] > begin) & (stamps[long] < end)):
            kept.append(one)
    return Pass(name, group, drive, truth, kept, *window_s)
