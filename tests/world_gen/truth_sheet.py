"""The truth about a drawn junction, read from the TOML beside its map."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

FOLDER = Path(__file__).parents[1] / "data" / "junctions"
RING = "ring"


@dataclass(frozen=True, slots=True, kw_only=True)
class TrueArm:
    """One road: how many lanes for cars, and for buses alone, lead in and out."""

    road: str
    lanes_in: int
    lanes_out: int
    bus_in: int
    bus_out: int


@dataclass(frozen=True, slots=True, kw_only=True)
class TrueJunction:
    """What is true of one junction; movements are (from, to) by arm letter.

    `turns` holds each legal movement with its turn, None where the name of it is open.
    `waiting` holds for each pair that conflicts the movements of which one waits: one, or both
    where either answer is right. `entry_waits` tells for arms of a ring whether who enters waits.
    """

    kind: str | None
    control: str | None
    ring: str | None
    arms: Mapping[str, TrueArm]
    turns: Mapping[str, str | None]
    open: frozenset[str]
    waiting: Mapping[frozenset[str], frozenset[str]]
    entry_waits: Mapping[str, bool]


@dataclass(frozen=True, slots=True, kw_only=True)
class TrueMap:
    """The truth about one map."""

    name: str
    osm_file: Path
    drives: str
    junctions: tuple[TrueJunction, ...]


def true_maps(folder: Path = FOLDER) -> tuple[TrueMap, ...]:
    """Return the truths of all maps of a folder, by name."""
    return tuple(_read(path) for path in sorted(folder.glob("*.toml")))


def _read(path: Path) -> TrueMap:
    sheet = tomllib.loads(path.read_text(encoding="utf-8"))
    return TrueMap(
        name=path.stem,
        osm_file=path.with_suffix(".osm"),
        drives=sheet["drives"],
        junctions=tuple(_junction(entry, path) for entry in sheet["junction"]),
    )


def _junction(entry: Mapping[str, object], path: Path) -> TrueJunction:
    known = {
        "kind",
        "control",
        "ring",
        "arms",
        "straight",
        "left",
        "right",
        "u_turn",
        "any_turn",
        "open",
        "yields",
        "each_waits_once",
    }
    assert set(entry) <= known, f"{path.name}: unknown keys {set(entry) - known}"
    arms = entry["arms"]
    assert isinstance(arms, dict)
    turns: dict[str, str | None] = {}
    for turn in ("straight", "left", "right", "u_turn", "any_turn"):
        for movement in _words(entry, turn):
            assert movement not in turns, f"{path.name}: {movement} stands twice"
            start, end = movement.split(">")
            lanes = (arms[start]["in"], arms[end]["out"])
            assert all(lanes), f"{path.name}: {movement} has no lane"
            turns[movement] = None if turn == "any_turn" else turn
    waiting: dict[frozenset[str], frozenset[str]] = {}
    entry_waits: dict[str, bool] = {}
    for first, others in _rows(entry, "yields", " | "):
        for other in others:
            if RING in (first, other):
                entry_waits[first if other == RING else other] = other == RING
                continue
            pair = frozenset((first, other))
            assert pair <= turns.keys(), f"{path.name}: {first} | {other} are no movements"
            assert pair not in waiting, f"{path.name}: {first} | {other} is answered twice"
            waiting[pair] = frozenset((first,))
    for first, others in _rows(entry, "each_waits_once", " & "):
        waiting[frozenset((first, *others))] = frozenset((first, *others))
    return TrueJunction(
        kind=_text(entry, "kind"),
        control=_text(entry, "control"),
        ring=_text(entry, "ring"),
        arms={
            letter: TrueArm(
                road=arm["road"],
                lanes_in=arm["in"],
                lanes_out=arm["out"],
                bus_in=arm.get("bus_in", 0),
                bus_out=arm.get("bus_out", 0),
            )
            for letter, arm in arms.items()
        },
        turns=turns,
        open=frozenset(_words(entry, "open")),
        waiting=waiting,
        entry_waits=entry_waits,
    )


def _text(entry: Mapping[str, object], key: str) -> str | None:
    value = entry.get(key)
    assert value is None or isinstance(value, str)
    return value


def _words(entry: Mapping[str, object], key: str) -> list[str]:
    return (_text(entry, key) or "").split()


def _rows(entry: Mapping[str, object], key: str, mark: str) -> list[tuple[str, list[str]]]:
    rows = entry.get(key, [])
    assert isinstance(rows, list)
    parted = [row.split(mark) for row in rows]
    return [(first, others.split(", ")) for first, others in parted]
