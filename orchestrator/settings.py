"""Settings from a TOML file, decoded and checked into frozen structs; errors in one line."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any, NamedTuple, TypeVar

import msgspec
import msgspec.inspect

from foretwin.contracts.errors import UserError
from foretwin.contracts.toml_file import toml_text

Settings = TypeVar("Settings", bound=msgspec.Struct)


def read_toml(path: Path, what: str, *, error: type[UserError] = UserError) -> dict[str, Any]:
    """Return what a TOML file holds; raises FileNotFoundError, calling it `what`, or `error`."""
    text = toml_text(path, what, error=error)
    try:
        values: dict[str, Any] = msgspec.toml.decode(text)
    except msgspec.DecodeError as wrong:
        raise error(f"{path}: not TOML: {wrong}") from wrong
    return values


def settings_from(
    values: Any, kind: type[Settings], where: str, *, error: type[UserError] = UserError
) -> Settings:
    """Return values as settings; raises `error` saying `where`, what is wrong and what is known."""
    try:
        return msgspec.convert(values, kind)
    except msgspec.ValidationError as wrong:
        raise error(f"{where} {_in_words(str(wrong), kind)}") from wrong


_AT = " - at `$"
_STEP = re.compile(r"\.(\w+)|\[")


def _in_words(text: str, kind: type[msgspec.Struct]) -> str:
    """Return what msgspec found, with the values or settings that there are at that place."""
    what, _, at = text.partition(_AT)
    place = at.strip("`.")
    found = [msgspec.inspect.type_info(kind)]
    for step in _STEP.finditer(at):
        found = [one for before in found for one in _inside(before, step[1])]
    if what.startswith("Invalid enum value "):
        literals = (one for one in found if isinstance(one, msgspec.inspect.LiteralType))
        values = ", ".join(str(value) for literal in literals for value in literal.values)
        return f"{place} {what.removeprefix('Invalid enum value ')}: one of {values}"
    if "unknown field" in what:
        structs = (one for one in found if isinstance(one, msgspec.inspect.StructType))
        names = ", ".join(field.encode_name for struct in structs for field in struct.fields)
        return f"{text} (known settings: {names})"
    return text


def _inside(around: msgspec.inspect.Type, field: str | None) -> list[msgspec.inspect.Type]:
    """Return the types that a field of a type may have, or its items, with those of unions."""
    match around:
        case msgspec.inspect.StructType() if field is not None:
            found = [one.type for one in around.fields if one.encode_name == field]
        case msgspec.inspect.VarTupleType() if field is None:
            found = [around.item_type]
        case msgspec.inspect.DictType() if field is None:
            found = [around.value_type]
        case _:
            found = []
    unions = (one.types if isinstance(one, msgspec.inspect.UnionType) else (one,) for one in found)
    return [one for types in unions for one in types]


class AtFault(NamedTuple):
    """A setting as a file calls it, and what is said of it."""

    name: str
    rest: str


_SHORTER = {"rate": "rate_hz", "horizon": "horizon_s", "start": "start_s", "end": "end_s"}
"""Settings whose flag leaves out the unit."""


def setting_of(text: str) -> AtFault | None:
    """Return the setting that an error begins with, by its flag or by its name."""
    found = re.match(r"(--)?([a-z0-9_-]+)", text)
    if found is None:
        return None
    name = found[2].replace("-", "_")
    return AtFault(_SHORTER.get(name, name) if found[1] else name, text[found.end() :])
