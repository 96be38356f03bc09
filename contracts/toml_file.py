"""Files that users write in TOML, read into a type and checked."""

from __future__ import annotations

import tomllib
from collections.abc import Callable
from pathlib import Path
from typing import TypeVar

import msgspec

from foretwin.contracts.errors import MissingFileError, UserError

_Read = TypeVar("_Read")


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
    file, and with the file and the field for anything else.
    """
    try:
        found = msgspec.convert(tomllib.loads(path.read_text(encoding="utf-8")), kind)
        check(found)
    except (FileNotFoundError, IsADirectoryError) as error:
        raise MissingFileError(f"no {what} file {path}") from error
    except UnicodeDecodeError as error:
        raise UserError(f"{what} file {path} is no UTF-8 text") from error
    except tomllib.TOMLDecodeError as error:
        raise UserError(f"{what} file {path} is no TOML: {error}") from error
    except msgspec.ValidationError as error:
        raise UserError(f"{what} file {path}: {words(str(error))}") from error
    except ValueError as error:
        raise UserError(f"{what} file {path}: {error}") from error
    return found
