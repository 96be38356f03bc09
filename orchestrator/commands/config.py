"""The command `config`: files that users write, explained by the types that they are read into."""

from __future__ import annotations

import functools
import inspect
import textwrap
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import msgspec

from foretwin.contracts.did_you_mean import meant
from foretwin.contracts.errors import UserError
from foretwin.contracts.field_words import FieldWords, fields_of, summary_of
from foretwin.orchestrator.commands.cli_drive import drive
from foretwin.orchestrator.commands.config_formats import (
    HIDDEN,
    KINDS,
    RANGES,
    FileKind,
    kind_named,
    kind_of,
)
from foretwin.orchestrator.commands.config_schema import schema_of
from foretwin.orchestrator.commands.output import print_json
from foretwin.orchestrator.commands.told import CommandResult
from foretwin.orchestrator.settings import flag_of


class Key(NamedTuple):
    """A key of some kind of file: where it stands, and what is known of it."""

    kind: str
    place: str
    type: type[msgspec.Struct]
    field: FieldWords

    @property
    def known(self) -> str:
        """Its kind of value, default and range in a few words."""
        allowed = RANGES.get((self.type, self.field.name))
        words = [self.field.kind]
        words += [str(allowed)] if allowed else []
        words += ["needed"] if self.field.required else []
        default = self.field.shown_default
        words += [f"default {default}"] if default else []
        if self.kind == "drive" and self.place in _flags():
            words.append(flag_of(self.place))
        return ", ".join(words)


@functools.cache
def _flags() -> frozenset[str]:
    """Return the settings of a drive that flags set."""
    names = inspect.signature(drive).parameters.keys() - {"config"}
    return frozenset(name.removesuffix("_file") for name in names)


def example(kind: str) -> CommandResult:
    """Return a file of a kind, with what each key is in comments."""
    text = example_of(kind_named(kind)).rstrip()
    return CommandResult({"kind": kind, "example": text}, text)


def schema(kind: str) -> CommandResult:
    """Return the JSON Schema of a kind of file, for editors; in words it is JSON as well."""
    found = schema_of(kind_named(kind))
    return CommandResult(found, lambda: print_json(found))


def explain(name: str, *, kind: str | None) -> CommandResult:
    """Return what a key is, in every kind of file that has it; UserError for one that none has."""
    every = [key for one in ([kind] if kind else KINDS) for key in keys_of(one)]
    found = [key for key in every if name in (key.place, key.field.name)]
    if not found:
        names = {key.field.name for key in every} | {key.place for key in every}
        where = f" of kind {kind}" if kind else ""
        raise UserError(
            f"--explain {name}: no file{where} has this key; {meant(name, sorted(names))}"
            "foretwin config --example shows all"
        )
    lines = []
    for key in found:
        lines.append(f"{key.kind}: {key.place} ({key.known})")
        if text := text_of(key):
            lines.append(f"  {text}")
    return CommandResult(
        [{"kind": k.kind, "key": k.place, "is": k.known, "text": text_of(k)} for k in found],
        "\n".join(lines),
    )


def check(path: Path, *, kind: str | None) -> CommandResult:
    """Read a file as whoever uses it does; UserError, with the line, for what is wrong in it."""
    name = kind or kind_of(path)
    kind_named(name).read(path)
    found = {"file": path, "kind": name, "sound": True}
    return CommandResult(found, f"{path}: sound; {name}: {KINDS[name].what}")


def keys_of(kind: str) -> Iterator[Key]:
    """Yield every key of a kind of file, outer ones first."""

    def below(struct: type[msgspec.Struct], around: str, seen: tuple[type, ...]) -> Iterator[Key]:
        for field in fields_of(struct):
            if (struct, field.name) in HIDDEN:
                continue
            place = f"{around}{field.name}"
            yield Key(kind, place, struct, field)
            for inner in dict.fromkeys(field.inner):
                if inner not in seen:
                    yield from below(inner, f"{place}.", (*seen, inner))

    top = kind_named(kind).type
    yield from below(top, "", (top,))


def text_of(key: Key) -> str:
    """Return what a key is: its own words, else those of the table that it holds."""
    return key.field.text or " ".join(summary_of(inner) for inner in key.field.inner)


def example_of(kind: FileKind) -> str:
    """Return a file of a kind that can be read as it is; what may be left out is in comments."""
    written = kind.example()
    if written is not None:
        return written
    lines = [f"# {kind.what}: every key that may stand here, with its default.", ""]
    begun = {line.split(" =")[0].strip("[]") for line in kind.begins.splitlines()}
    lines += [kind.begins] if kind.begins else []
    tables: list[tuple[str, type[msgspec.Struct]]] = [("", kind.type)]
    for header, struct in tables:  # which grows
        lines += ["", f"# {header}"] if header and header.strip("[]") not in begun else []
        for field in fields_of(struct):
            if (struct, field.name) in HIDDEN or (field.name in begun and not field.inner):
                continue
            if field.inner and not header:
                many = field.kind.startswith("list")
                name = f"{field.name}.NAME" if field.kind.startswith("table of") else field.name
                tables.append((f"[[{name}]]" if many else f"[{name}]", field.inner[0]))
                continue
            allowed = RANGES.get((struct, field.name))
            told = f"{field.text} ({field.kind}{f', {allowed}' if allowed else ''})".strip()
            lines += textwrap.wrap(told, 98, initial_indent="# ", subsequent_indent="# ")
            lines.append(f"# {field.name} = {field.shown_default or '…'}")
    return "\n".join(lines) + "\n"
