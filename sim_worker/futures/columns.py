"""Columns of tables, and rows that fill them: in words, or of the fields of a message.

A message within a message fills one column for each of its own fields, named after both.
"""

from __future__ import annotations

import functools
from collections.abc import Mapping
from typing import Any, Literal, get_args, get_origin

import msgspec
import pyarrow as pa

RESULT_SCHEMA_VERSION = 1
"""Of the tables of results: raised where a column means something else."""

Columns = dict[str, type]

_ARROW = {
    bool: pa.bool_(),
    int: pa.int64(),
    float: pa.float64(),
    str: pa.string(),
    bytes: pa.binary(),
    dict: pa.map_(pa.string(), pa.float64()),
}
_WORDS = {kind.__name__: kind for kind in _ARROW}


def schema(columns: Mapping[str, type]) -> pa.Schema:
    """Return columns as Arrow has them, in their order."""
    return pa.schema([(name, _ARROW[kind]) for name, kind in columns.items()])


def columns(words: str) -> Columns:
    """Return columns from words `name:type`."""
    pairs = (word.split(":") for word in words.split())
    return {name: _WORDS[kind] for name, kind in pairs}


def columns_of(message: type[msgspec.Struct], names: str = "") -> Columns:
    """Return the columns that the named fields of a message fill, or all of its fields."""
    found: Columns = {}
    for name, kind in _fields(message, names).items():
        if issubclass(kind, msgspec.Struct):
            found |= {f"{name}_{inner}": of for inner, of in columns_of(kind).items()}
        else:
            found[name] = kind
    return found


def row_of(message: msgspec.Struct, names: str = "") -> dict[str, Any]:
    """Return the row that fills `columns_of` a message; None for a message that is not there."""
    row: dict[str, Any] = {}
    for name, kind in _fields(type(message), names).items():
        value = getattr(message, name)
        if issubclass(kind, msgspec.Struct):
            row |= {f"{name}_{inner}": getattr(value, inner, None) for inner in columns_of(kind)}
        else:
            row[name] = value
    return row


@functools.cache
def _fields(message: type[msgspec.Struct], names: str) -> dict[str, type]:
    kinds = {field.name: _plain(field.type) for field in msgspec.structs.fields(message)}
    return {name: kinds[name] for name in names.split()} if names else kinds


def _plain(kind: Any) -> type:
    """Return what a field holds where it is not None; words of a choice are text."""
    origin = get_origin(kind)
    if origin is Literal:
        return str
    choices = [one for one in get_args(kind) if one is not type(None)]
    plain: type = _plain(choices[0]) if len(choices) == 1 else origin or kind
    return plain
