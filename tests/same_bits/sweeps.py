"""A small sweep: every future's trajectory, and what its rows say of it."""

from __future__ import annotations

import hashlib
import math
import struct
from collections import Counter
from collections.abc import Container, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import pyarrow.parquet as pq

from tests.same_bits.comparison import Section
from tests.same_bits.sides import Side, SideError, on_both
from tests.same_bits.worlds import embedded_map

TRAJECTORY = ("trajectory_sha256",)
"""The column of the hash of ego and road users, by the names that it may have."""
NOT_COMPARED = frozenset({"cell", "job", "future_id", "values", *TRAJECTORY})
"""Columns that number or identify rows; those that one side alone has are not compared either."""
SAID_OR_NOT = frozenset({"failure", "left_out"})
"""Columns of words that may be put better: whether they say anything is compared."""
CODES = {"collision_with": {None: 0, "": 0, "road_user": 1, "static": 2}}
"""Words that may become numbers, or the other way round."""
ABOUT = ("scenario", "case", "planner", "junction")
BERLIN_MAP = "osm-berlin-mitte/berlin-mitte.osm"
SPEC = """
map = "{map}"
sample = {junctions}
planners = ["pure_pursuit_idm", "gap_acceptance", "frenet_lattice", "constant_speed"]
scenarios = {scenarios}
cases = {cases}
seed = {seed}

[parameters]
friction_factor = [1.0, 0.5]
"""
QUICK_SCENARIOS = """["scp", "ccftap", "cpta", "occluded_pedestrian", "reversing_parking"]"""
SCENARIOS = """["scp", "ccftap", "cpta", "cbta", "ltap_od", "ltip", "rtip", "cccscp", "red_light",
    "occluded_pedestrian", "reversing_parking", "lead_stopping", "roundabout_entry",
    "emergency_vehicle", "brake_fault", "latency"]"""

Row = Mapping[str, Any]


def compare_sweeps(
    sides: tuple[Side, Side], *, data: Path | None, quick: bool, seed: int
) -> list[Section]:
    """Return the futures of a sweep over the drawn town, and with data of one in Berlin."""
    settings = {"junctions": 1 if quick else 3, "cases": 1 if quick else 3, "seed": seed,
                "scenarios": QUICK_SCENARIOS if quick else SCENARIOS}  # fmt: skip
    maps: dict[str, Path | None] = {"town": None}
    if data is not None:
        maps["berlin"] = data / BERLIN_MAP
    sections = []
    for name, file in maps.items():

        def rows(side: Side, name: str = name, file: Path | None = file) -> list[dict[str, Any]]:
            return sweep(side, name, SPEC.format(map=file or embedded_map(side), **settings))

        sections += sections_of(f"sweep {name}", *on_both(sides, rows))
    return sections


def sections_of(title: str, base: Sequence[Row], head: Sequence[Row]) -> list[Section]:
    """Return the trajectories of two sweeps, and what rows of trajectories of both say of them."""
    futures = trajectories(base), trajectories(head)
    both = futures[0].keys() & futures[1].keys()
    said = columns(base, both), columns(head, both)
    return [
        Section(f"{title}: futures", *futures, about=about(head) | about(base)),
        Section(f"{title}: columns", *said, common_only=True),
    ]


def sweep(side: Side, name: str, spec: str) -> list[dict[str, Any]]:
    """Play a sweep; returns its rows."""
    file, out = side.scratch / f"{name}.toml", side.scratch / f"sweep-{name}"
    file.write_text(spec, encoding="utf-8")
    side.run(f"sweep-{name}", "sweep", str(file), "--out", str(out), "--workers", "1")
    found: list[dict[str, Any]] = []
    for path in sorted(out.rglob("*.parquet")):
        if set(TRAJECTORY) & set(pq.read_schema(path).names):
            found += pq.read_table(path).to_pylist()
    if not found:
        raise SideError(f"{side.name}: sweep {name}: no Parquet file has {' or '.join(TRAJECTORY)}")
    return found


def trajectories(rows: Iterable[Row]) -> dict[str, dict[str, str]]:
    """Return how often each trajectory was driven."""
    count = Counter(_trajectory(row) for row in rows)
    return {sha256: {"times": str(times)} for sha256, times in sorted(count.items())}


def about(rows: Iterable[Row]) -> dict[str, str]:
    """Return of each trajectory where it was driven, and by whom."""
    return {_trajectory(row): " ".join(str(row.get(name, "")) for name in ABOUT) for row in rows}


def columns(rows: Iterable[Row], among: Container[str]) -> dict[str, dict[str, str]]:
    """Return by column the digest of its values, of rows with one of these trajectories."""
    values: dict[str, list[bytes]] = {}
    for row in (row for row in rows if _trajectory(row) in among):
        for name in row.keys() - NOT_COMPARED:
            said = _trajectory(row).encode() + _bytes(name, row[name])
            values.setdefault(name, []).append(said)
    return {
        name: {"values": hashlib.sha256(b"".join(sorted(said))).hexdigest()[:32]}
        for name, said in sorted(values.items())
    }


def _trajectory(row: Row) -> str:
    found = next((row[name] for name in TRAJECTORY if name in row), None)
    return found or "not played"


def _bytes(name: str, value: Any) -> bytes:
    if name in SAID_OR_NOT:
        value = bool(value)
    elif name in CODES and not isinstance(value, int):
        value = CODES[name][value]
    if value is None or (isinstance(value, float) and math.isnan(value)):
        return b"none;"
    if isinstance(value, (bool, int)):
        return f"i{int(value)};".encode()
    if isinstance(value, float):
        return b"f" + struct.pack("<d", value)
    return f"{value!r};".encode()
