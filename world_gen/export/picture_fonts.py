"""Fonts for names in all scripts: those installed that have the letters, or a mark where none has.

matplotlib brings DejaVu alone, which draws Latin, Greek, Cyrillic, Arabic, Hebrew, Armenian and
Georgian letters, and boxes for all others. Other fonts of the machine follow it where a text needs
them; what no font has is left out, so that a picture holds no boxes.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import cache
from typing import NamedTuple

from matplotlib.font_manager import FontEntry, fontManager, get_font

from foretwin.contracts.left_out import without

PLAIN, FIXED = "sans-serif", "monospace"
_DEJAVU = {PLAIN: "DejaVu Sans", FIXED: "DejaVu Sans Mono"}
_LATIN_END = 0x250
"""Letters below it are in every font that is tried."""
_LAST_RESORT = "Last Resort"
"""Begins the names of fonts that have a box for every letter."""


class Fonts(NamedTuple):
    """Families to draw a text with, one after another, and letters that none of them has."""

    more: tuple[str, ...] = ()
    missing: frozenset[str] = frozenset()

    def families(self, kind: str) -> list[str]:
        """Return the families for text of a kind, `PLAIN` or `FIXED`."""
        return [_DEJAVU[kind], *self.more] if self.more else [kind]

    def drawable(self, text: str) -> str:
        """Return the text with a mark for each run of letters that no font has."""
        return without(text, self.missing)


def fonts_for(text: str) -> Fonts:
    """Return the fonts of this machine that a text needs beside DejaVu."""
    wanted = {letter for letter in text if ord(letter) >= _LATIN_END and not letter.isspace()}
    if not wanted:
        return Fonts()
    found: list[str] = []
    missing = wanted - (_letters(_path(_DEJAVU[PLAIN])) & _letters(_path(_DEJAVU[FIXED])))
    for entry in _others():
        if not missing:
            break
        if had := missing & _letters(entry.fname):
            found.append(entry.name)
            missing -= had
    return Fonts(tuple(found), frozenset(missing))


def _others() -> Iterator[FontEntry]:
    """Yield the upright fonts of the machine, DejaVu Sans first, which has more than its Mono."""
    entries = [e for e in fontManager.ttflist if e.style == "normal" and e.name != _DEJAVU[FIXED]]
    usable = (e for e in entries if not e.name.startswith(_LAST_RESORT))
    yield from sorted(usable, key=lambda e: (e.name != _DEJAVU[PLAIN], e.name, e.fname))


def _path(family: str) -> str:
    return str(fontManager.findfont(family))


@cache
def _letters(path: str) -> frozenset[str]:
    try:
        return frozenset(map(chr, get_font(path).get_charmap()))
    except (OSError, RuntimeError):
        return frozenset()  # a broken font of the machine is no reason to fail
