"""How commands say what they found: as JSON, as a table, or in a file that is a page."""

from __future__ import annotations

import csv
import io
import os
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import msgspec

from foretwin.contracts.errors import UserError
from foretwin.contracts.new_folder import trouble_with_folder
from foretwin.contracts.terminal import console, say, words

if TYPE_CHECKING:
    from rich.table import Column


def check_html_file(path: Path, option: str, what: str) -> None:
    """Refuse, before what takes long is begun, a file to write that is no HTML file or cannot be
    one; `what` is what will stand in it. Raises UserError."""
    if path.suffix.lower() not in (".html", ".htm"):
        raise UserError(f"{option} {path}: {what} is an HTML file, such as {path.stem}.html")
    if path.is_dir():
        raise UserError(f"{option} {path}: is a folder")
    if (trouble := trouble_with_folder(path.parent)) is not None:
        raise UserError(f"{option} {path}: {trouble}")


def size_words(size_bytes: int) -> str:
    """Return the size of a file in words: kB below a megabyte, each of 1,000 bytes."""
    return f"{size_bytes / 1e6:.1f} MB" if size_bytes >= 1e6 else f"{size_bytes / 1e3:.0f} kB"


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
