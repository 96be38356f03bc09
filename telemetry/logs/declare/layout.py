"""How a table's text is laid out: what separates its cells, where its names and its rows begin.

Programs write lines of their own before the names, units below them, or remarks; rows are what most
lines are, and names are the first line of as many cells that stands before them.
"""

from __future__ import annotations

import csv
import io
import itertools
from collections import Counter
from pathlib import Path
from typing import Literal, NamedTuple

from foretwin.telemetry.logs.log import LogError
from foretwin.telemetry.logs.table_cells import BLANKS, rows_of

_DELIMITERS = (";", "\t", ",", "|", BLANKS)
"""A semicolon first: with it commas are decimal. Blanks last: they stand in dates and names too."""
_LINES_LOOKED_AT = 200
_VBO = {"[column names]", "[data]"}
_LEAST_LIKE = 0.5
"""So many lines have as many cells."""
_NUMBERS = 0.3
"""So many filled cells of a row are numbers; of names and units none, but for a year or so."""


class TextLayout(NamedTuple):
    """What a declaration says of a table's text; `rows_from` is the line that the rows begin at."""

    delimiter: str
    decimal: Literal[".", ","]
    header: bool
    skip_lines: int
    rows_from: int


def layout_of(path: Path, text: str) -> TextLayout:
    """Return how a text is laid out; raises LogError where it is no table."""
    # Lines as they are read: other line breaks of Unicode stand in cells.
    head = itertools.islice(io.StringIO(text[: 1 << 18]), _LINES_LOOKED_AT)
    lines = [line.rstrip("\n") for line in head]
    if len(lines) < 2:
        raise LogError(f"{path}: no table: {len(lines)} lines")
    if {line.strip().lower() for line in lines} >= _VBO:
        raise LogError(
            f"{path}: Racelogic's VBO, which is not read: its longitudes grow to the west; export"
            " it as CSV with degrees"
        )
    delimiter, width = max(
        ((sign, *_usual_width(lines, sign)) for sign in _DELIMITERS),
        key=lambda one: (one[2] > _LEAST_LIKE * len(lines), one[0] != BLANKS, one[2]),
    )[:2]
    rows = [_cells(line, delimiter) for line in lines]
    decimal: Literal[".", ","] = "," if _commas_are_decimal(rows, delimiter) else "."
    first = next(
        (
            number
            for number, row in enumerate(rows)
            if len(row) >= width and _numbers(row, decimal) > _NUMBERS
        ),
        len(rows),
    )
    above = [
        number
        for number in range(first)
        if len(rows[number]) >= width - 1 and not lines[number].isspace()
    ]
    # What stands apart from the rows, or is told twice, names no columns.
    above = [number for number in above if all(one in above for one in range(number, first))]
    apart = [number for number in above if len(set(rows[number])) == len(rows[number])]
    if not above:
        return TextLayout(delimiter, decimal, False, first if first < len(rows) else 0, first)
    return TextLayout(delimiter, decimal, True, (apart or above)[0], first)


def _is_number(cell: str) -> bool:
    """Tell whether a cell is a number written with a point."""
    try:
        float(cell)
    except ValueError:
        return False
    return True


def _usual_width(lines: list[str], delimiter: str) -> tuple[int, int]:
    """Return how many cells most lines have, more than one, and how many lines that are."""
    widths = Counter(len(_cells(line, delimiter)) for line in lines)
    several = [(count, width) for width, count in widths.items() if width > 1]
    count, width = max(several, default=(0, 1))
    return width, count


def _cells(line: str, delimiter: str) -> list[str]:
    try:
        return next(iter(rows_of([line], delimiter)), [])
    except csv.Error:
        return [line]


def _commas_are_decimal(rows: list[list[str]], delimiter: str) -> bool:
    return delimiter != "," and any(
        _is_number(cell.replace(",", ".")) for row in rows for cell in row if cell.count(",") == 1
    )


def _numbers(row: list[str], decimal: str) -> float:
    filled = [cell for cell in row if cell.strip()]
    return sum(_is_number(cell.replace(decimal, ".")) for cell in filled) / max(len(filled), 1)
