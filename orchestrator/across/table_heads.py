"""Whether the files of tables are whole, of this foretwin, and which columns they have.

Of a thousand files nearly all have the columns of one another. So a file is parsed once, and of
the next ones it is only seen that their ends begin with the same bytes: names and types of columns
stand first in the metadata of Parquet.
"""

from __future__ import annotations

import os
from collections.abc import Iterable
from pathlib import Path
from typing import IO

import pyarrow as pa

from foretwin.contracts.errors import UserError
from foretwin.orchestrator.record.result_files import check_result_schema, opened

_MAGIC, _END_BYTES = b"PAR1", 8
"""At a file's end, the last after the length of the metadata."""


class TableHeads:
    """Looks at files of one table; keeps the columns of each kind that it met."""

    def __init__(self) -> None:
        self.fields: dict[str, pa.DataType] = {}
        """Every column that a file has, those of the first file first."""
        self._known: list[tuple[bytes, bytes]] = []

    def trouble(self, file: Path) -> str:
        """Return why a file cannot be read, in a line; nothing where it can."""
        try:
            footer = footer_of(file)
            if not self._is_known(footer):
                with opened(file) as table:
                    self._know(file, table.schema_arrow, footer)
        except (UserError, OSError) as error:
            return " ".join(str(error).split())
        return ""

    def _is_known(self, footer: bytes) -> bool:
        return any(footer.startswith(begin) and told in footer for begin, told in self._known)

    def _know(self, file: Path, schema: pa.Schema, footer: bytes) -> None:
        told = check_result_schema(file, schema)["result_schema"]
        self.fields |= {one.name: one.type for one in schema if one.name not in self.fields}
        self._known.append((_columns_in(footer, schema), _pair("result_schema", told)))


def footer_of(file: Path) -> bytes:
    """Return the metadata at the end of a Parquet file; UserError where it has no whole one."""
    with file.open("rb") as source:
        length = _footer_length(file, source)
        source.seek(-length - _END_BYTES, os.SEEK_END)
        return source.read(length)


def not_whole(files: Iterable[Path]) -> str:
    """Return what is wrong with the first file that is cut short, nothing where all are whole."""
    for file in files:
        try:
            with file.open("rb", buffering=0) as source:
                _footer_length(file, source)
        except (UserError, OSError) as error:
            return " ".join(str(error).split())
    return ""


def _footer_length(file: Path, source: IO[bytes]) -> int:
    size = source.seek(0, os.SEEK_END)
    source.seek(max(size - _END_BYTES, 0))
    end = source.read(_END_BYTES)
    length = int.from_bytes(end[: -len(_MAGIC)], "little")
    if not end.endswith(_MAGIC) or length + _END_BYTES + len(_MAGIC) > size:
        raise UserError(f"{file}: is cut short or damaged: no whole Parquet")
    return length


def _columns_in(footer: bytes, schema: pa.Schema) -> bytes:
    """Return the metadata up to and with the name of the last column."""
    end = 0
    for name in schema.names:
        end = footer.index(name.encode(), end) + len(name.encode())
    return footer[:end]


def _pair(key: str, value: str) -> bytes:
    """Return a key and its value as metadata of Parquet holds them (Thrift's compact protocol:
    two fields of bytes, each with its length before it)."""
    return b"".join(b"\x18" + bytes([len(word)]) + word.encode() for word in (key, value))
