"""Settings and the flags that set them: which is which, and what is wrong in one line."""

from __future__ import annotations

import re
from typing import Any, NamedTuple, TypeVar

import msgspec

from foretwin.contracts.errors import UserError
from foretwin.contracts.type_words import dotted, in_words

Settings = TypeVar("Settings", bound=msgspec.Struct)


def settings_of_flags(
    values: Any, kind: type[Settings], *, error: type[UserError] = UserError
) -> Settings:
    """Return what flags say as settings; raises `error` with the flag at fault."""
    try:
        return msgspec.convert(values, kind)
    except msgspec.ValidationError as wrong:
        place, text = in_words(wrong, kind, values)
        flag, named = flag_of(str(place[0]) if place else ""), dotted(place)
        said = text.removeprefix(named) if place and text.startswith(named) else f": {text}"
        # A flag's text is written without the quotes that it has in a file.
        raise error(flag + re.sub(r"^ '(\S*)'", r" \1", said)) from wrong


class AtFault(NamedTuple):
    """A setting as a file calls it, and what is said of it."""

    name: str
    rest: str


_SHORTER = {"rate": "rate_hz", "horizon": "horizon_s", "start": "start_s", "end": "end_s"}
"""Settings whose flag leaves out the unit."""


def flag_of(name: str) -> str:
    """Return the flag of a setting."""
    short = next((flag for flag, setting in _SHORTER.items() if setting == name), name)
    return f"--{short.replace('_', '-')}"


def setting_of(text: str) -> AtFault | None:
    """Return the setting that an error begins with, by its flag or by its name."""
    found = re.match(r"(--)?([a-z0-9_-]+)", text)
    if found is None:
        return None
    name = found[2].replace("-", "_")
    return AtFault(_SHORTER.get(name, name) if found[1] else name, text[found.end() :])
