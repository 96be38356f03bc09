"""A declaration as the TOML that is read again, with what is to be said of each section."""

from __future__ import annotations

import json
import textwrap
from collections.abc import Mapping, Sequence
from typing import Any

import msgspec

from foretwin.contracts.terminal import plain
from foretwin.telemetry.logs.declaration import Column, Declaration

_WIDTH = 100


def declaration_toml(
    declaration: Declaration, *, said: Mapping[str, Sequence[str]] | None = None
) -> str:
    """Return the TOML of a declaration; keys that have their default are left out.

    `said` are lines by section, written as comments above it.
    """
    said = said or {}
    sections = [
        (name, value)
        for name in declaration.__struct_fields__
        if isinstance(value := getattr(declaration, name), msgspec.Struct)
    ]
    text = "".join(
        f"{name} = {_value(getattr(declaration, name))}\n"
        for name in _given(declaration)
        if name not in dict(sections)
    )
    for name, section in sections:
        text += "\n" + comment_lines(said.get(name, ())) + f"[{name}]\n"
        text += "".join(f"{key} = {_value(getattr(section, key))}\n" for key in _given(section))
    return text


def comment_lines(lines: Sequence[str]) -> str:
    """Return lines as comments, folded; what names of columns hold stays on its line."""
    return "".join(
        f"{part}\n"
        for line in lines
        for part in textwrap.wrap(
            plain(line), _WIDTH, initial_indent="# ", subsequent_indent="#   "
        )
    )


def _given(struct: msgspec.Struct) -> list[str]:
    fields = msgspec.structs.fields(struct)
    return [row.name for row in fields if getattr(struct, row.name) != row.default]


def _value(value: Any) -> str:
    match value:
        case Column():
            rows = (f"{name} = {_value(getattr(value, name))}" for name in _given(value))
            return f"{{ {', '.join(rows)} }}"
        case bool():
            return "true" if value else "false"
        case tuple():
            return f"[{', '.join(map(_value, value))}]"
        case str():
            # JSON's strings are TOML's, but for the control character that JSON lets stand.
            return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")
    return repr(value)
