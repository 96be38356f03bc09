"""How commands print what they found: as JSON, or as a table."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING

import msgspec

if TYPE_CHECKING:
    from rich.table import Column


def print_json(body: object) -> None:
    """Print a message, or what holds messages, as indented JSON."""
    print(msgspec.json.format(msgspec.json.encode(body), indent=1).decode())


def print_table(
    title: str, columns: Sequence[Column | str], rows: Iterable[Sequence[object]]
) -> None:
    """Print rows below the names of their columns."""
    from rich.console import Console
    from rich.table import Table

    table = Table(*columns, title=title)
    for row in rows:
        table.add_row(*(str(value) for value in row))
    Console().print(table)
