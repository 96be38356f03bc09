"""Writing a drive to a CSV and its declaration, one row per stamp, in the project's own units.

A CSV holds positions, speed, heading, IMU, steering and commands. A value that some samples of a
channel lack and others have would make these rows unreadable: its column is left out, and a
channel that is left without any is too.
"""

from __future__ import annotations

import csv
import itertools
import json
from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import Any, NamedTuple

from foretwin.contracts.drive import VehicleInfo
from foretwin.telemetry.logs.log import LogError, Sample


class _Column(NamedTuple):
    """A field of a declaration's section and its unit."""

    field: str
    unit: str


class _Section(NamedTuple):
    """How one channel becomes columns; `more` are further lines of its section."""

    name: str
    columns: tuple[_Column, ...]
    values: Callable[[Any], tuple[float | None, ...]]
    more: str = ""


_ANGLES = (_Column("wheel", "rad"), _Column("tire", "rad"))
_SECTIONS: dict[str, _Section] = {
    "gnss": _Section(
        "position",
        (
            _Column("latitude", "deg"),
            _Column("longitude", "deg"),
            _Column("altitude", "m"),
            _Column("std", "m"),
        ),
        lambda m: (m.position.lat_deg, m.position.lon_deg, m.position.alt_m, m.std_m),
        more='frame = "wgs84"\n',
    ),
    "speed": _Section("speed", (_Column("forward", "m/s"),), lambda m: (m.speed_mps,)),
    "heading": _Section(
        "heading",
        (_Column("yaw", "rad"), _Column("yaw_rate", "rad/s")),
        lambda m: (m.yaw_rad, m.yaw_rate_radps),
        more='zero = "east"\ndirection = "counterclockwise"\n',
    ),
    "imu": _Section(
        "imu",
        tuple(_Column(f"accel_{axis}", "m/s2") for axis in "xyz")
        + tuple(_Column(f"rate_{axis}", "rad/s") for axis in "xyz"),
        lambda m: (*m.accel_mps2, *m.rate_radps),
        more='axes = "forward-left-up"\n',
    ),
    "steering": _Section("steering", _ANGLES, lambda m: (m.steering_wheel_rad, m.tire_angle_rad)),
    "control": _Section(
        "control",
        (_Column("accel", "m/s2"), *_ANGLES),
        lambda m: (m.accel_mps2, m.steering_wheel_rad, m.tire_angle_rad),
    ),
}


def write_csv(
    samples: Callable[[], Iterable[Sample]], info: VehicleInfo, table: Path, declaration: Path
) -> tuple[Counter[str], Counter[str]]:
    """Write what `samples` yields, which is asked twice, and return counts and what was left out.

    Raises LogError where there is no position.
    """
    counts, left_out = Counter[str](), Counter[str]()
    kept = _columns(samples(), left_out)
    if "gnss" not in kept:
        raise LogError(f"{table}: a CSV needs positions, and there are none")
    names = [
        f"{channel}_{_SECTIONS[channel].columns[place].field}"
        for channel, places in kept.items()
        for place in places
    ]
    with table.open("w", encoding="utf-8", newline="") as text:
        writer = csv.writer(text, lineterminator="\n")
        writer.writerow(["stamp_ns", *names])
        for stamp_ns, row in _rows(samples(), kept, counts):
            writer.writerow([stamp_ns, *row])
    declaration.write_text(_declaration(info, kept), encoding="utf-8")
    return counts, left_out


def _columns(samples: Iterable[Sample], left_out: Counter[str]) -> dict[str, tuple[int, ...]]:
    """Return the places of each channel's columns that every sample of it has."""
    totals: Counter[str] = Counter()
    present: dict[str, list[int]] = {}
    for channel, message in samples:
        if channel not in _SECTIONS:
            left_out[f"{channel} has no place in a CSV"] += 1
            continue
        totals[channel] += 1
        values = _SECTIONS[channel].values(message)
        seen = present.setdefault(channel, [0] * len(values))
        for place, value in enumerate(values):
            seen[place] += value is not None
    kept: dict[str, tuple[int, ...]] = {}
    for channel in (name for name in _SECTIONS if name in present):
        seen, total = present[channel], totals[channel]
        places = tuple(place for place, count in enumerate(seen) if count == total)
        for place, count in enumerate(seen):
            if 0 < count < total:
                field = _SECTIONS[channel].columns[place].field
                left_out[f"{channel} {field}, which only some samples have"] += count
        if places:
            kept[channel] = places
    return kept


def _rows(
    samples: Iterable[Sample], kept: dict[str, tuple[int, ...]], counts: Counter[str]
) -> Iterator[tuple[int, list[str]]]:
    wanted = (sample for sample in samples if sample[0] in kept)
    grouped = itertools.groupby(wanted, key=lambda sample: sample[1].stamp_ns)  # type: ignore[attr-defined]
    for stamp_ns, group in grouped:
        found = dict(group)
        counts.update(found.keys())
        row: list[str] = []
        for channel, places in kept.items():
            if channel in found:
                values = _SECTIONS[channel].values(found[channel])
                row += [repr(float(values[place] or 0.0)) for place in places]
            else:
                row += [""] * len(places)
        yield stamp_ns, row


def _declaration(info: VehicleInfo, kept: dict[str, tuple[int, ...]]) -> str:
    # JSON's strings are TOML's.
    text = f"reference_point = {json.dumps(info.reference_point)}\n"
    if info.body_from_antenna_m is not None:
        text += f"body_from_antenna_m = {list(map(float, info.body_from_antenna_m))}\n"
    text += f'\n[time]\ncolumn = "stamp_ns"\nunit = "ns"\nbase = "{info.time_base}"\n'
    for channel, places in kept.items():
        section = _SECTIONS[channel]
        text += f"\n[{section.name}]\n{section.more}"
        for place in places:
            column = section.columns[place]
            name = f"{channel}_{column.field}"
            text += f'{column.field} = {{ column = "{name}", unit = "{column.unit}" }}\n'
    return text
