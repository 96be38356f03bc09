"""Files that users write in TOML, read into a type and checked."""

from __future__ import annotations

import tomllib
from collections.abc import Callable
from pathlib import Path
from typing import TypeVar

import msgspec

from foretwin.contracts.errors import MissingFileError, UserError

_Read = TypeVar("_Read")


def toml_text(path: Path, what: str, *, error: type[UserError] = UserError) -> str:
    """Return the text of a TOML file, which is UTF-8, with a byte order mark or without.

    Raises FileNotFoundError, calling the file `what`, or `error` with the line at fault.
    """
    if path.is_dir():
        raise error(f"{what} {path}: is a folder, not a file")
    try:
        data = path.read_bytes()
    except FileNotFoundError:
        raise MissingFileError(f"{what} {path}: no such file") from None
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError as wrong:
        line = data.count(b"\n", 0, wrong.start) + 1
        raise error(
            f"{what} {path}: line {line} is no UTF-8 text (byte 0x{data[wrong.start]:02x}); "
            "save the file as UTF-8"
        ) from wrong


def read_toml(
    path: Path,
    kind: type[_Read],
    *,
    what: str,
    check: Callable[[_Read], object],
    words: Callable[[str], str] = str,
) -> _Read:
    """Return what a file of some kind, such as "scenario", holds.

    `check` raises ValueError for what is wrong though it has the right fields; `words` says in the
    user's words what msgspec found. Raises UserError in one line: MissingFileError for a missing
    file, and with the file and the line or field for anything else.
    """
    try:
        text = toml_text(path, f"{what} file")
    except FileNotFoundError as error:
        raise MissingFileError(f"no {what} file {path}") from error
    try:
        found = msgspec.convert(tomllib.loads(text), kind)
        check(found)
    except tomllib.TOMLDecodeError as error:
        raise UserError(f"{what} file {path} is no TOML: {error}") from error
    except msgspec.ValidationError as error:
        raise UserError(f"{what} file {path}: {words(str(error))}") from error
    except ValueError as error:
        raise UserError(f"{what} file {path}: {error}") from error
    return found
