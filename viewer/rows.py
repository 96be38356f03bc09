"""What is logged: one row per entity and instant, independent of the stream it goes to."""

from __future__ import annotations

import re
import unicodedata
from typing import NamedTuple

import numpy as np
import rerun as rr

from foretwin.contracts.arrays import Array, Array32
from foretwin.contracts.left_out import LEFT_OUT, without

APPLICATION_ID = "foretwin"
TIMELINE = "drive_time"

_MARKUP = re.compile(r"[\\`*\[\]<>|!&~]")
_SAFE_BEYOND_LATIN = frozenset("–—‘’“”„•…→←↑↓≤≥≈−")  # noqa: RUF001
"""Signs of our own texts; every font of the viewer has them."""
_LAST_LATIN = 0x24F
_SHOWN_BEYOND_LATIN = (
    range(0x386, 0x3CF),  # Greek
    range(0x400, 0x460),  # Cyrillic, and of other languages than Slavic ones
    range(0x490, 0x49C),
    range(0x4A0, 0x500),
    range(0x1E00, 0x1F00),  # Latin with accents, as in Vietnamese
    range(0x1F00, 0x2000),  # Greek with more accents
)
"""Letters that Rerun 0.41's own font has: each was drawn."""


class Row(NamedTuple):
    """Components of one entity at one instant.

    `drive_ns` is drive time in nanoseconds, None for what holds at all times. `lasting` rows are
    few and everything else is unreadable without them (the map, colours, names): a crowded live
    viewer loses them last.
    """

    path: str
    drive_ns: int | None
    components: rr.AsComponents
    lasting: bool = False


def static(path: str, components: rr.AsComponents) -> Row:
    """Return a row that holds at all times."""
    return Row(path, None, components, lasting=True)


def document(text: str) -> rr.TextDocument:
    """Return a text in Markdown."""
    return rr.TextDocument(text, media_type=rr.MediaType.MARKDOWN)


def point_at(xy_m: Array, z_m: float) -> list[float]:
    """Return a point of the drive's frame at a height."""
    return [float(xy_m[0]), float(xy_m[1]), z_m]


def raised(line_m: Array | Array32, z_m: float) -> Array:
    """Return a line (N, 2) at a height, (N, 3)."""
    return np.column_stack([line_m, np.full(len(line_m), z_m)])


def plain_text(text: str) -> str:
    """Return `text` with a mark for each run of letters that the viewer's fonts lack.

    Rerun 0.41's headless viewer crashes on all of them, CJK, Arabic and emoji among them, and
    street names have such. Letters with a Latin base keep it.
    """
    composed = unicodedata.normalize("NFC", text)
    shown = {letter: _shown(letter) for letter in {*composed, LEFT_OUT}}
    marked = without(composed, (letter for letter, how in shown.items() if how is None))
    return "".join(shown[letter] or "" for letter in marked)


def _shown(letter: str) -> str | None:
    """Return what stands for a letter in the viewer, nothing for an accent; None: it cannot be."""
    if letter == "\n" or letter in _SAFE_BEYOND_LATIN:
        return letter
    if ord(letter) <= _LAST_LATIN:
        return letter if letter.isprintable() else " "
    if letter.isalpha() and any(ord(letter) in letters for letters in _SHOWN_BEYOND_LATIN):
        return letter
    base = "".join(c for c in unicodedata.normalize("NFKD", letter) if ord(c) <= _LAST_LATIN)
    return base or ("" if unicodedata.combining(letter) else None)


def place_text(name: str, place_id: str) -> str:
    """Return the name of a place, its id where it has none, both where not all of it is shown."""
    return f"{name} {place_id}" if LEFT_OUT in plain_text(name) else name or place_id


def in_markdown(text: str) -> str:
    """Return `plain_text` as a line of Markdown that shows it: no link, picture, HTML or cell."""
    line = " ".join(plain_text(text).split("\n"))
    return _MARKUP.sub(r"\\\g<0>", line)


def path_part(text: str) -> str:
    """Return `text` escaped as one part of an entity path; different texts give different ones."""
    letters = (letter if letter.isascii() else f"u{ord(letter):x}" for letter in text)
    return str(rr.escape_entity_path_part("".join(letters)))
