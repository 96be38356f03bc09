"""Which of the known names somebody meant who mistyped one."""

from __future__ import annotations

import difflib
from collections.abc import Iterable

_CLOSE = 0.6
"""As alike as difflib asks for unless told otherwise: two letters in five may be wrong."""


def meant(given: str, known: Iterable[str]) -> str:
    """Return `did you mean X? `, with the known name nearest to what was given; else nothing.

    A name that begins with what was given counts as near, and so does one in other cases of
    letters or with `-` for `_`.
    """
    names = {_plain(name): name for name in known}
    wanted = _plain(given)
    near = difflib.get_close_matches(wanted, names, n=1, cutoff=_CLOSE)
    if not near and len(wanted) > 2:
        near = [name for name in names if name.startswith(wanted)][:1]
    return f"did you mean {names[near[0]]}? " if near else ""


def one_of(given: object, known: Iterable[str]) -> str:
    """Return what to say of a value that is none of the known ones: the nearest, then all."""
    names = tuple(known)
    return f"{meant(str(given), names)}one of {', '.join(names)}"


def _plain(name: str) -> str:
    return name.strip("-").replace("-", "_").lower()
