"""Writing a drive to a CSV and its declaration, one row per stamp, in the project's own units.

A CSV holds positions, speed, heading, IMU, steering and commands. A value that some samples of a
channel lack and others have would make these rows unreadable: its column is left out, and a
channel that is left without any is too.
"""

from __future__ import annotations

import csv
import itertools
from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import Any

import msgspec

from foretwin.contracts.drive import VehicleInfo
from foretwin.telemetry.logs.columns import CHANNEL_COLUMNS
from foretwin.telemetry.logs.declaration import (
    UNITS,
    Column,
    ControlSection,
    Declaration,
    HeadingSection,
    ImuSection,
    PositionSection,
    SpeedSection,
    SteeringSection,
    TimeSection,
)
from foretwin.telemetry.logs.log import LogError, Sample
from foretwin.telemetry.logs.write_declaration import declaration_toml

_MORE: dict[str, dict[str, str]] = {
    "gnss": {"frame": "wgs84"},
    "heading": {"zero": "east", "direction": "counterclockwise"},
    "imu": {"axes": "forward-left-up"},
}
"""Further keys of a channel's section in the declaration."""
_SECTIONS: dict[str, Callable[..., Any]] = {
    "gnss": PositionSection,
    "speed": SpeedSection,
    "heading": HeadingSection,
    "imu": ImuSection,
    "steering": SteeringSection,
    "control": ControlSection,
}
DECLARATION_MARK = "# Written by foretwin convert"
"""How a declaration begins that `convert` may replace."""


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
    names = [f"{channel}_{field}" for channel, fields in kept.items() for field in fields]
    with table.open("w", encoding="utf-8", newline="") as text:
        writer = csv.writer(text, lineterminator="\n")
        writer.writerow(["stamp_ns", *names])
        for stamp_ns, row in _rows(samples(), kept, counts):
            writer.writerow([stamp_ns, *row])
    declaration.write_text(_declaration(info, kept), encoding="utf-8")
    return counts, left_out


def _columns(samples: Iterable[Sample], left_out: Counter[str]) -> dict[str, tuple[str, ...]]:
    """Return the fields of each channel that every sample of it has."""
    totals: Counter[str] = Counter()
    present: Counter[tuple[str, str]] = Counter()
    for channel, message in samples:
        if channel not in CHANNEL_COLUMNS:
            left_out[f"{channel} has no place in a CSV"] += 1
            continue
        totals[channel] += 1
        numbers = _numbers(channel, message)
        present.update((channel, field) for field, number in numbers.items() if number is not None)
    kept: dict[str, tuple[str, ...]] = {}
    for channel, row in CHANNEL_COLUMNS.items():
        for field in row.fields:
            count = present[channel, field]
            if count and count == totals[channel]:
                kept[channel] = (*kept.get(channel, ()), field)
            elif count:
                left_out[f"{channel} {field}, which only some samples have"] += count
    return kept


def _numbers(channel: str, message: msgspec.Struct) -> dict[str, float | None]:
    row = CHANNEL_COLUMNS[channel]
    return dict(zip(row.fields, row.numbers(message), strict=True))


def _rows(
    samples: Iterable[Sample], kept: dict[str, tuple[str, ...]], counts: Counter[str]
) -> Iterator[tuple[int, list[str]]]:
    wanted = (sample for sample in samples if sample[0] in kept)
    grouped = itertools.groupby(wanted, key=lambda sample: sample[1].stamp_ns)  # type: ignore[attr-defined]
    for stamp_ns, group in grouped:
        found = dict(group)
        counts.update(found.keys())
        row: list[str] = []
        for channel, fields in kept.items():
            numbers = _numbers(channel, found[channel]) if channel in found else {}
            row += [repr(float(numbers[name] or 0.0)) if numbers else "" for name in fields]
        yield stamp_ns, row


def _declaration(info: VehicleInfo, kept: dict[str, tuple[str, ...]]) -> str:
    sections = {
        CHANNEL_COLUMNS[channel].section: _SECTIONS[channel](
            **{field: Column(f"{channel}_{field}", next(iter(UNITS[field]))) for field in fields},
            **_MORE.get(channel, {}),
        )
        for channel, fields in kept.items()
    }
    declaration = Declaration(
        reference_point=info.reference_point,
        body_from_antenna_m=info.body_from_antenna_m,
        time=TimeSection(column="stamp_ns", unit="ns", base=info.time_base),
        **sections,
    )
    return (
        f"{DECLARATION_MARK}, which replaces it with its CSV; without this line it is kept.\n"
        + declaration_toml(declaration)
    )
