"""Settings from a TOML file, decoded and checked into frozen structs; errors in one line."""

from __future__ import annotations

from pathlib import Path
from typing import Any, TypeVar

import msgspec

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
        known = ", ".join(kind.__struct_fields__)
        raise error(f"{where} {wrong} (known settings: {known})") from wrong
