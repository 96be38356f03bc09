"""Files that users write in TOML, read into a type and checked; errors name the line."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple, TypeVar

import msgspec

from foretwin.contracts.errors import MissingFileError, UserError
from foretwin.contracts.toml_lines import Place, line_at, lines_of
from foretwin.contracts.type_words import in_words, undotted

_Read = TypeVar("_Read", bound=msgspec.Struct)
_SYNTAX = re.compile(r" \(at line (\d+), column \d+\)$")
_KEY = re.compile(r"\[*([A-Za-z_]\w*(?:\.\w+|\[\d+\])*)")


class TomlFile(NamedTuple):
    """What a TOML file holds, and how it is called in errors."""

    name: str
    text: str
    values: dict[str, Any]
    error: type[UserError] = UserError

    def convert(self, kind: type[_Read], *, table: str | None = None) -> _Read:
        """Return the file, or one table of it, as `kind`; raises its error naming line and key."""
        values = self.values if table is None else self.values[table]
        try:
            return msgspec.convert(values, kind)
        except msgspec.ValidationError as wrong:
            place, text = in_words(wrong, kind, values)
            where = () if table is None else (table,)
            raise self.at((*where, *place), text) from wrong

    def at(self, place: Place, text: str) -> UserError:
        """Return the error that says `text` of a place in the file."""
        line = line_at(lines_of(self.text), place)
        return self.error(f"{self.name}: {'' if line is None else f'line {line}: '}{text}")

    def wrong(self, found: Exception | str, *, table: str | None = None) -> UserError:
        """Return the error for what a check found, whose text begins with the key at fault."""
        text = str(found)
        key = _KEY.match(text)
        place = undotted(key[1]) if key else ()
        known = lines_of(self.text)
        for around in ((table,) if table else (), ()):
            if place and (*around, *place[:1]) in known:
                return self.at((*around, *place), text)
        return self.error(f"{self.name}: {text}")


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


def parse_toml(text: str, name: str, *, error: type[UserError] = UserError) -> TomlFile:
    """Return a TOML text that errors call `name`; raises `error` with the line that is no TOML."""
    try:
        return TomlFile(name, text, tomllib.loads(text), error)
    except tomllib.TOMLDecodeError as wrong:
        said = str(wrong)
        line = _SYNTAX.search(said)
        end = len(text.splitlines()) if line is None else line[1]
        raise error(f"{name}: line {end}: not TOML: {_SYNTAX.sub('', said)}") from wrong


def load_toml(path: Path, what: str, *, error: type[UserError] = UserError) -> TomlFile:
    """Return what a TOML file holds; raises as `toml_text` and `parse_toml`."""
    return parse_toml(toml_text(path, what, error=error), str(path), error=error)


def read_toml(
    path: Path,
    kind: type[_Read],
    *,
    what: str,
    check: Callable[[_Read], object] | None = None,
    error: type[UserError] = UserError,
) -> _Read:
    """Return what a file of some kind, such as "scenario", holds.

    `check` raises ValueError, beginning with the key, for what is wrong though it has the right
    fields. Raises `error` in one line with the file, the line and the key, and FileNotFoundError
    for a missing file.
    """
    name = f"{what} file {path}"
    try:
        file = parse_toml(toml_text(path, f"{what} file", error=error), name, error=error)
    except FileNotFoundError as missing:
        raise MissingFileError(f"no {name}") from missing
    found = file.convert(kind)
    if check is not None:
        try:
            check(found)
        except ValueError as wrong:
            raise file.wrong(wrong) from wrong
    return found
