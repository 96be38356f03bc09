"""The one error that means: the input cannot be used, and the user can mend it."""

from __future__ import annotations


class UserError(ValueError):
    """One line that names the file, field or value at fault and what would be right."""


class MissingFileError(FileNotFoundError, UserError):
    """A file that was named is not there."""


def one_line(error: Exception) -> str:
    """Return an error as one line of text."""
    return f"{type(error).__name__}: {' '.join(str(error).split())}"
