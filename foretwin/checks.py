"""What is given to the face, checked: mistakes become `UserError`, in one line."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from numbers import Real
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from foretwin.contracts.errors import UserError

_Kind = TypeVar("_Kind")


def expect(what: str, given: object, kind: type[_Kind]) -> _Kind:
    """Return what was given; raises UserError where it is of another kind."""
    if not isinstance(given, kind):
        raise UserError(f"{what} must be a {kind.__name__}, not {type(given).__name__}")
    return given


def whole_number(what: str, given: Any, least: int, most: int) -> int:
    """Return a whole number, numpy's too; raises UserError for anything else or out of range."""
    if not isinstance(given, int | np.integer) or not least <= given <= most:
        raise UserError(f"{what} {given!r}: a whole number from {least} to {most}")
    return int(given)


def number(what: str, given: Any) -> float:
    """Return a number, numpy's too; raises UserError for anything else."""
    if not isinstance(given, Real):
        raise UserError(f"{what} must be a number, not {given!r}")
    return float(given)


def path_of(what: str, given: object) -> Path:
    """Return a path; raises UserError for anything else."""
    if not isinstance(given, Path | str):
        raise UserError(f"{what} must be a path, not {type(given).__name__}")
    return Path(given)


@contextmanager
def files_told(file: Path) -> Iterator[None]:
    """Say as UserError which file cannot be read or written, and why."""
    try:
        yield
    except OSError as error:
        raise UserError(f"{file}: {error.strerror or error}") from error
