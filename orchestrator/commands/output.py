"""How commands print what they found: as JSON, or as a table."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING

import msgspec

from foretwin.contracts.terminal import console, say, words

if TYPE_CHECKING:
    from rich.table import Column


def print_json(body: object) -> None:
    """Print a message, or what holds messages, as indented JSON."""
    say(msgspec.json.format(msgspec.json.encode(body), indent=1).decode())


def print_table(
    title: str, columns: Sequence[Column | str], rows: Iterable[Sequence[object]]
) -> None:
    """Print rows below the names of their columns."""
    from rich.table import Table

    table = Table(*columns, title=words(title))
    for row in rows:
        table.add_row(*(words(str(value)) for value in row))
    console().print(table)
