"""What a report is made of before it becomes HTML: sections of prose, facts, tables, pictures.

Nothing here knows of HTML, so that sections are pure functions from what a run left to these types,
and all their words can be looked through at once where places are to be left out.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import Any, Literal, NamedTuple

import msgspec

UNKNOWN = "\u2013"
"""Stands where a value is not known, or does not apply."""
_UNBROKEN = "\u00a0"
_DECIMAL = re.compile(rf"-?\d+(?:\.(?P<decimals>\d+))?(?P<unit>(?:{_UNBROKEN}\D+)?)")
"""What `number` writes."""
_RAISED = str.maketrans(
    "-0123456789", "\u207b\u2070\u00b9\u00b2\u00b3\u2074\u2075\u2076\u2077\u2078\u2079"
)

Tone = Literal["", "good", "watch", "bad", "quiet"]
"""How a word is to be taken; red is for what one acts upon."""


class TableCell(NamedTuple):
    """One cell of a table: its words, what it is sorted by, an anchor in this report."""

    text: str
    order: float | None = None
    """None where it is sorted by its words."""
    to: str = ""
    tone: Tone = ""
    code: bool = False


class Prose(NamedTuple):
    """A paragraph."""

    text: str
    tone: Tone = ""


class Listed(NamedTuple):
    """A table; `numeric` are the columns whose numbers stand right, by their place."""

    title: str
    columns: tuple[str, ...]
    rows: tuple[tuple[TableCell, ...], ...]
    numeric: frozenset[int] = frozenset()
    note: str = ""
    folded: bool = False
    """Whether it stands closed until somebody opens it; on paper it is open."""


class Facts(NamedTuple):
    """Names and values, one below the other."""

    pairs: tuple[tuple[str, str], ...]


class Drawn(NamedTuple):
    """A picture as SVG, with the words below it."""

    svg: str
    caption: str
    wide: bool = False


class Plotted(NamedTuple):
    """A plot of bokeh, with the words below it."""

    figure: Any
    caption: str


class CommandLine(NamedTuple):
    """A command that the reader may run."""

    text: str
    what: str = ""


Block = Prose | Listed | Facts | Drawn | Plotted | CommandLine


class KeyFigure(NamedTuple):
    """One of the few numbers on the first page."""

    value: str
    name: str
    note: str = ""
    tone: Tone = ""


class Chapter(NamedTuple):
    """A section of a report, with those inside it; `anchor` is what links inside the file name."""

    anchor: str
    title: str
    blocks: tuple[Block, ...]
    parts: tuple[Chapter, ...] = ()


class Report(NamedTuple):
    """A whole report: the first page, and the sections behind it."""

    title: str
    subtitle: str
    verdict: str
    tone: Tone
    figures: tuple[KeyFigure, ...]
    front: tuple[Block, ...]
    parts: tuple[Chapter, ...]
    attribution: tuple[str, ...]
    counted: msgspec.Struct | None = None
    """Its figures as a message, where it has some that a program would ask for; without places."""
    unread: tuple[str, ...] = ()
    """What there should be of the folders and is missing or could not be read, in words."""


def row(*cells: TableCell | str) -> tuple[TableCell, ...]:
    """Return a row of a table; plain words are cells that are sorted by themselves."""
    return tuple(TableCell(cell) if isinstance(cell, str) else cell for cell in cells)


def number(value: float | None, digits: int = 1, unit: str = "", *, tone: Tone = "") -> TableCell:
    """Return a number as a cell; UNKNOWN where it is not known."""
    if value is None or value != value:
        return TableCell(UNKNOWN, order=None, tone="quiet")
    words = f"{value:.{digits}f}" + (f"{_UNBROKEN}{unit}" if unit else "")
    return TableCell(words, order=float(value), tone=tone)


def scientific(value: float | None, *, tone: Tone = "") -> TableCell:
    """Return a small number as a cell, such as a criticality."""
    if value is None or value != value:
        return TableCell(UNKNOWN, tone="quiet")
    return TableCell(power(value), order=float(value), tone=tone)


def change_between(first: TableCell, last: TableCell) -> TableCell:
    """Return by how much two cells of one row differ, written as they are."""
    if first.order is None or last.order is None:
        return number(None)
    change = last.order - first.order
    size, written = power(abs(change)), [_DECIMAL.fullmatch(one.text) for one in (first, last)]
    if shown := [one for one in written if one is not None] if all(written) else []:
        digits = max(len(one["decimals"] or "") for one in shown)
        size = f"{abs(change):.{digits}f}{shown[0]['unit']}"
    if not set(size) & set("123456789"):
        return TableCell("same", order=0.0, tone="quiet")
    return TableCell(f"{'+' if change > 0.0 else '-'}{size}", order=change)


def power(value: float, digits: int = 1) -> str:
    """Return a small positive number as people write it: with a power of ten below a hundredth."""
    if value == 0.0:
        return "0"
    if value >= 0.01:
        return f"{value:.2g}"
    figure, _, exponent = f"{value:.{digits}e}".partition("e")
    return f"{figure}\u00b710{str(int(exponent)).translate(_RAISED)}"


def plural(count: int, one: str, many: str = "") -> str:
    """Return a count with its noun."""
    return f"{count:,} {one if count == 1 else many or one + 's'}".replace(",", "\u202f")


def listed_words(words: Sequence[str]) -> str:
    """Return words as a sentence lists them."""
    if len(words) < 2:
        return "".join(words)
    return f"{', '.join(words[:-1])} and {words[-1]}"
