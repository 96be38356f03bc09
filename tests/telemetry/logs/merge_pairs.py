"""`python -m tests.telemetry.logs.merge_pairs`: pairs of recordings on one clock, and how far off.

Real drives are split: one sensor stays on its clock, another gets a clock with a drawn offset and
drift, every n-th sample and a part of the drive. Two receivers of one car, both by UTC, are a pair
as they are. What a sensor was late by before it was split is found and told apart: "late before".
Drives that do not belong together, and clocks that jump, have to be refused. Exit code 3 where an
offset is missed by more than three of its standard deviations and _ROUGHLY_S, or where such were
put together.
"""

from __future__ import annotations

import argparse
import os
import sys
import tempfile
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from foretwin.telemetry.logs import Log, LogError, open_log
from foretwin.telemetry.logs.clock_between import ClockBetween, clock_between
from foretwin.telemetry.logs.columns import Stream, table_log
from tests.telemetry.logs.declare.disguised import Drive, drive_of
from tests.telemetry.logs.declare.fuzz import DECLARATIONS

_ROUGHLY_S = 0.1
_TOLD_NS = 270_000_000_000
"""Drives that last so long tell whether a clock jumps."""
DIFFERENT = 3


class Split(NamedTuple):
    """A real drive, and the channels of either recording with every how many of their samples."""

    name: str
    folder: str
    pattern: str
    declaration: str | None
    first: tuple[tuple[str, int], ...]
    second: tuple[tuple[str, int], ...]


_DATA, _DRIVES = "FORETWIN_DATA", "FORETWIN_DRIVES"
SPLITS = (
    Split("smartLoc: positions, odometry", _DATA, "drive-berlin-potsdamer-platz", None,
          (("gnss", 1),), (("speed", 1), ("imu", 1))),
    Split("smartLoc: odometry, positions at 1 Hz", _DATA, "drive-berlin-potsdamer-platz", None,
          (("speed", 1), ("imu", 1)), (("gnss", 5),)),
    Split("comma2k19: CAN, positions at 2 Hz", _DATA, "drive-comma2k19-sf/segment40", None,
          (("speed", 1), ("steering", 1)), (("gnss", 10),)),
    Split("comma2k19: CAN, IMU", _DATA, "drive-comma2k19-sf/segment40", None,
          (("speed", 1), ("steering", 1)), (("imu", 1),)),
    Split("Dresden: GPS, IMU at 10 Hz", _DATA, "drive-dresden-imu/2014-03-26-000-Data.csv",
          "dresden.csv.toml", (("gnss", 1), ("speed", 1)), (("imu", 5),)),
    Split("Boreas: positions at 1 Hz, heading", _DATA, "drive-boreas-toronto/*.csv",
          "boreas.csv.toml", (("gnss", 10),), (("heading", 1), ("speed", 1))),
    Split("F9K: positions, speed", _DRIVES, "mountain-view-nmea/*.nmea", None,
          (("gnss", 1),), (("speed", 1),)),
    Split("Pixel 4: positions, speed", _DRIVES, "pixel4/2020*chipset.nmea", None,
          (("gnss", 1),), (("speed", 1),)),
)  # fmt: skip
RECEIVERS = (
    ("F9K and SPAN, two receivers", "mountain-view-nmea/*.nmea", "mountain-view-nmea/*.gga",
     "2020-02-07"),
    ("Pixel 4 and SPAN, two receivers", "pixel4/2020*chipset.nmea", "pixel4/2020*SPAN*.nmea",
     "2020-05-29"),
)  # fmt: skip
"""Name, either recording, and the day of the second, which does not tell it."""


class Pair(NamedTuple):
    """Two recordings, and the truth: the second's clock says `offset_s` more at the first's start,
    and that grows by `ppm`."""

    first: Log
    second: Log
    offset_s: float
    ppm: float


_Drives = Sequence[tuple[Split, Drive]]
_Strangers = tuple[str, Log, Log]


def main(arguments: Sequence[str]) -> int:
    """Merge pairs that belong together and pairs that do not; print what was found."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--draws", type=int, default=3, help="pairs made of each drive")
    asked = parser.parse_args(arguments)
    random = np.random.default_rng(asked.seed)
    wrong = 0
    print("| pair | true offset s | ppm | late before s | found, less both s | ppm found | |")
    print("|---|---|---|---|---|---|---|")
    for name, first, second, day in RECEIVERS:
        pair = receivers(first, second, day)
        wrong += pair is not None and told(name, pair, 0.0)
    drives = [(split, drive) for split in SPLITS if (drive := read(split)) is not None]
    for split, drive in drives:
        late_s = late_before_s(split, drive)
        for draw in range(asked.draws):
            ppm = 0.0 if draw < asked.draws - 1 else float(random.choice([-150.0, 80.0, 200.0]))
            pair = made(split, drive, random, ppm=ppm)
            wrong += told(split.name, pair, late_s)
    strangers = [*of_two_drives(drives, random), *of_two_halves(drives), *jumped(drives)]
    refused = sum(is_refused(name, *logs) for name, *logs in strangers)
    print(f"{refused} of {len(strangers)} strangers and clocks that jump refused in a line")
    return DIFFERENT if wrong or refused < len(strangers) else 0


def of_two_drives(drives: _Drives, random: np.random.Generator) -> Iterator[_Strangers]:
    """Yield each recording with those of all other drives."""
    for one, ours in drives:
        for other, theirs in drives:
            if one.pattern != other.pattern:
                first = made(one, ours, random, ppm=0.0).first
                yield (
                    f"{one.name}; {other.name}",
                    first,
                    made(other, theirs, random, ppm=0.0).second,
                )


def of_two_halves(drives: _Drives) -> Iterator[_Strangers]:
    """Yield what one recording tells of a drive's begin with what the other tells of its end."""
    for split, drive in drives:
        halves: list[Drive] = [{}, {}]
        for name, stream in drive.items():
            half = len(stream.stamps_ns) // 2
            for number, part in enumerate((slice(0, half), slice(half, None))):
                columns = {field: values[part] for field, values in stream.columns.items()}
                halves[number][name] = Stream(stream.stamps_ns[part], columns)
        first, second = (
            recording(halves[0], split.first, "A"),
            recording(halves[1], split.second, "B"),
        )
        yield f"{split.name}: two halves", first, second


def jumped(drives: _Drives) -> Iterator[_Strangers]:
    """Yield recordings of which the second's clock jumps, of drives that are long enough."""
    for split, drive in drives:
        stamps_ns = np.concatenate([stream.stamps_ns for stream in drive.values()])
        if np.ptp(stamps_ns) < _TOLD_NS:
            continue
        for jump_s, share in ((0.3, 0.5), (1.0, 0.5), (1.0, 0.8), (2.0, 0.5), (2.0, 0.8)):
            at_ns = stamps_ns.min() + share * np.ptp(stamps_ns)
            late = {
                name: Stream(
                    one.stamps_ns + np.where(one.stamps_ns > at_ns, round(jump_s * 1e9), 0),
                    one.columns,
                )
                for name, one in drive.items()
            }
            name = f"{split.name}: a jump of {jump_s} s at {share}"
            yield name, recording(drive, split.first, "A"), recording(late, split.second, "B")


def is_refused(name: str, first: Log, second: Log) -> bool:
    """Tell whether two recordings are refused in a line; prints what was found where not."""
    try:
        clock = clock_between(first, second)
    except LogError as error:
        return "\n" not in str(error)
    print(f"NOT OF ONE DRIVE: {name}: {clock.said('B', 'A')}")
    return False


def told(name: str, pair: Pair, late_s: float) -> bool:
    """Print a row of the table; returns whether a wrong offset was taken."""
    row = f"| {name} | {pair.offset_s:.3f} | {pair.ppm:+.0f} | {late_s:+.3f} "
    try:
        clock = clock_between(pair.first, pair.second)
    except LogError as error:
        print(f"{row}| | | refused: {str(error).partition(': ')[2]} |")
        return False
    off_s = missed_s(pair, clock) - late_s
    allowed_s = max(3.0 * clock.std_s, _ROUGHLY_S)
    drift = f"{clock.drift_ppm:+.0f} ± {clock.drift_std_ppm:.0f}" if clock.drift_ppm else "none"
    wrong = abs(off_s) > allowed_s
    verdict = "WRONG" if wrong else f"{clock.by}, r = {clock.like:.3f}"
    print(f"{row}| {off_s:+.3f} ± {clock.std_s:.3f} | {drift} | {verdict} |")
    return wrong


def missed_s(pair: Pair, clock: ClockBetween) -> float:
    """Return by how much the offset found is more than the true one, where it was found."""
    return clock.offset_s - (pair.offset_s + pair.ppm * 1e-6 * clock.at_s)


def late_before_s(split: Split, drive: Drive) -> float:
    """Return by how much the second's sensors are stamped later than the first's as recorded."""
    try:
        return clock_between(
            recording(drive, split.first, "A"), recording(drive, split.second, "B")
        ).offset_s
    except LogError:
        return 0.0


def receivers(first: str, second: str, day: str) -> Pair | None:
    """Return two receivers' positions of one drive, both by UTC, None where they are not here."""
    folder = Path(os.environ.get(_DRIVES, "nowhere"))
    files = next(folder.glob(first), None), next(folder.glob(second), None)
    if files[0] is None or files[1] is None:
        print(f"{first}, {second}: not in {_DRIVES}", file=sys.stderr)
        return None
    with tempfile.TemporaryDirectory() as scratch:
        declared = Path(scratch) / "day.toml"
        declared.write_text(f"date = {day}\n", encoding="utf-8")
        ours, theirs = (
            drive_of(open_log(files[0])),
            drive_of(open_log(files[1], declaration=declared)),
        )
    only = (("gnss", 1),)
    return Pair(recording(ours, only, "A"), recording(theirs, only, "B"), 0.0, 0.0)


def read(split: Split) -> Drive | None:
    """Return the samples of a drive, None where it is not here."""
    folder = os.environ.get(split.folder)
    file = next(Path(folder).glob(split.pattern), None) if folder else None
    if file is None:
        print(f"{split.name}: {split.pattern} is not in {split.folder}", file=sys.stderr)
        return None
    declared = None if split.declaration is None else DECLARATIONS / split.declaration
    return drive_of(open_log(file, declaration=declared))


def made(split: Split, drive: Drive, random: np.random.Generator, *, ppm: float) -> Pair:
    """Return two recordings of a drive: the second begins and ends elsewhere, by another clock."""
    starts, ends = zip(
        *((one.stamps_ns[0], one.stamps_ns[-1]) for one in drive.values()), strict=True
    )
    start_ns, lasts_s = int(min(starts)), (max(ends) - min(starts)) * 1e-9
    spare_s = max(lasts_s - 55.0, 0.0)
    from_s, until_s = 0.2 * spare_s * random.random(2) * (1.0, -1.0) + (0.0, lasts_s)
    offset_s = float(random.uniform(-9e3, 9e3))
    first = recording(drive, split.first, "A")
    lead_s = (first.info.start_stamp_ns - start_ns) * 1e-9
    moved = {}
    for name, _ in split.second:
        at_s = (drive[name].stamps_ns - start_ns) * 1e-9
        inside = (at_s >= from_s) & (at_s <= until_s)
        theirs_s = at_s[inside] + 1e4 + offset_s + ppm * 1e-6 * (at_s[inside] - lead_s)
        columns = {field: values[inside] for field, values in drive[name].columns.items()}
        moved[name] = Stream(np.round(theirs_s * 1e9).astype(np.int64), columns)
    # Both clocks count from elsewhere than zero, so that no stamp is below it.
    second = recording(moved, split.second, "B")
    return Pair(first, second, offset_s + 1e4 - start_ns * 1e-9, ppm)


def recording(drive: Drive, channels: Sequence[tuple[str, int]], source: str) -> Log:
    """Return every n-th sample of the channels named as a log."""
    streams = {
        name: Stream(
            drive[name].stamps_ns[::every],
            {field: values[::every] for field, values in drive[name].columns.items()},
        )
        for name, every in channels
    }
    stamps = np.sort(np.concatenate([one.stamps_ns for one in streams.values()]))
    return table_log(
        source, streams, stamps_ns=stamps, time_base="boot", reference_point="unknown"
    )  # fmt: skip


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
