"""Places out of a report: streets become letters, positions and ids of the map are left out."""

from __future__ import annotations

import re
import string
from collections.abc import Iterable, Iterator, Mapping
from html import escape
from pathlib import Path
from typing import Any, Literal

from foretwin.contracts.terminal import plain
from foretwin.contracts.world import World
from foretwin.orchestrator.report.blocks import Plotted, Report

Redaction = Literal["coarse", "places"]
"""Both take out names, ids and positions; `places` pictures as well."""

_LEFT_OUT = "\u2026"
_IDS = re.compile(
    r"\b[wnr]-?\d{4,}[\w.>/-]*|(?<=\bway )-?\d+|(?<=\bnode )-?\d+|(?<=\brelation )-?\d+"
)
_DEGREES = re.compile(r"-?\b\d{1,3}\.\d{5,}\b")
_SHORTEST_NAME = 2
"""As Q7 in Mannheim; one letter alone is a word of too many sentences."""
_NAME_FILES = frozenset(
    {"map", "log", "route", "file", "dem", "standin_dem", "network", "anchor", "road_user_log"}
)
"""Settings that name files which are called after places, as often as not."""


class PlaceNames:
    """Replaces what tells a place in words: each name by a letter, in the order of appearance.

    Pictures are SVG already, where an apostrophe or an ampersand is written otherwise.
    """

    def __init__(self, names: Iterable[str]) -> None:
        known = {name for name in names if len(name) >= _SHORTEST_NAME}
        self._names = {escape(plain(name)): name for name in known} | {name: name for name in known}
        self._letters: dict[str, str] = {}
        self._free = _letters()
        longest_first = sorted(self._names, key=lambda name: (-len(name), name))
        words = "|".join(re.escape(name) for name in longest_first)
        self._pattern = re.compile(rf"(?<!\w)(?:{words})(?!\w)") if known else None

    def without(self, text: str) -> str:
        """Return a text without names, ids of the map, and degrees."""
        if self._pattern is not None:
            text = self._pattern.sub(
                lambda found: f"street {self._letter(self._names[found[0]])}", text
            )
        return _DEGREES.sub(_LEFT_OUT, _IDS.sub(_LEFT_OUT, text))

    def _letter(self, name: str) -> str:
        if name not in self._letters:
            self._letters[name] = next(self._free)
        return self._letters[name]


def _letters() -> Iterator[str]:
    yield from string.ascii_uppercase
    for first in string.ascii_uppercase:
        yield from (first + second for second in string.ascii_uppercase)
    number = 0
    while True:
        number += 1
        yield f"No. {number}"


def names_of(record: Mapping[str, Any], worlds: Iterable[World]) -> set[str]:
    """Return every name that may tell where a run or sweep was: of streets, junctions and files."""
    found: set[str] = set()
    for one in (*(record.get("intersections") or ()), *(record.get("off_road") or ())):
        found |= _parts(one.get("name"))
    for world in worlds:
        called = (world.intersection.name, *(lane.name for lane in world.lanes))
        for name in (*called, *(road.name for road in world.roads)):
            found |= _parts(name)
        for junction in world.junctions:
            found |= _parts(junction.summary.name)
            for arm in junction.arms:
                found |= _parts(arm.name)
    for settings in (record.get("config") or {}, record.get("spec") or {}, record.get("map") or {}):
        for path in _files_in(settings):
            found |= {path.name, path.stem}
    return found


def _files_in(settings: Any) -> Iterator[Path]:
    """Yield the files of a drive and its place that settings name, those of other cars too."""
    if isinstance(settings, list | tuple):
        for one in settings:
            yield from _files_in(one)
    if isinstance(settings, Mapping):
        for name, value in settings.items():
            if isinstance(value, str) and name in _NAME_FILES and Path(value).suffix:
                yield Path(value)
            yield from _files_in(value)


def _parts(name: str | None) -> set[str]:
    return {part.strip() for part in re.split("[\u00d7;/]", name or "") if part.strip()}


def redacted(report: Report, names: PlaceNames) -> Report:
    """Return a report in whose words no place is told; plots hold figures alone."""

    def walked(value: Any) -> Any:
        if isinstance(value, str):
            return names.without(value)
        if isinstance(value, Plotted):
            return value._replace(caption=names.without(value.caption))
        if isinstance(value, tuple):
            inner = (walked(one) for one in value)
            return type(value)(*inner) if hasattr(value, "_fields") else tuple(inner)
        return value

    found: Report = walked(report)
    return found._replace(attribution=report.attribution)
