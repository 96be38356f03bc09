"""How commands print what they found: as JSON, or as a table."""

from __future__ import annotations

import csv
import io
import os
from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING

import msgspec

from foretwin.contracts.terminal import console, say, words

if TYPE_CHECKING:
    from rich.table import Column


def print_json(body: object) -> None:
    """Print a message, or what holds messages and paths, as indented JSON."""
    say(msgspec.json.format(msgspec.json.encode(body, enc_hook=os.fspath), indent=1).decode())


def print_csv(columns: Sequence[str], rows: Iterable[Sequence[object]]) -> None:
    """Print rows as comma-separated values below the names of their columns; None is empty."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(columns)
    writer.writerows(rows)
    say(text.getvalue().removesuffix("\n"))


def print_table(
    title: str, columns: Sequence[Column | str], rows: Iterable[Sequence[object]]
) -> None:
    """Print rows below the names of their columns."""
    from rich.table import Table

    table = Table(*columns, title=words(title))
    for row in rows:
        table.add_row(*(words(str(value)) for value in row))
    console().print(table)
