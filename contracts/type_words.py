"""What msgspec finds wrong with a user's values, in the user's words: which key, and what is right.

Nothing here knows of files: values may be those of a TOML file or of flags.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator
from typing import Any, NamedTuple

import msgspec
import msgspec.inspect

from foretwin.contracts.did_you_mean import meant, one_of

_AT = " - at `"
_STEP = re.compile(r"\.([^.\[]+)|\[(\d+|\.\.\.)\]")
_WORDS = {
    "int": "a whole number",
    "float": "a number",
    "str": "a text in quotes",
    "bool": "true or false",
    "array": "a list",
    "object": "a table",
    "null": "nothing",
}
_OF_VALUES = {
    "int": int, "float": float, "str": str, "bool": bool, "array": list, "object": dict,
    "null": type(None),
}  # fmt: skip
_ANY_KEY = "..."
"""What msgspec says for a key of a table whose keys are free."""


class Wrong(NamedTuple):
    """What is wrong, and at which place of the values: keys and indices from the top."""

    place: tuple[str | int, ...]
    text: str


def in_words(error: msgspec.ValidationError, kind: type[msgspec.Struct], values: Any) -> Wrong:
    """Return what msgspec found in values that were to be a `kind`, with what is known there."""
    what, _, at = str(error).partition(_AT)
    place: tuple[str | int, ...] = ()
    found = [msgspec.inspect.type_info(kind)]
    for name, index in _STEP.findall(at.rstrip("`")):
        place = (*place, name or (int(index) if index.isdigit() else index))
        found = [one for before in found for one in _inside(before, name)]
    quoted = re.search(r"`(.*)`$", what)
    if what.startswith("Object contains unknown field ") and quoted:
        place = _named(values, place, lambda given: quoted[1] in given)
        known = [field.encode_name for field in _fields(found)]
        around = f" in {dotted(place)}" if place else ""
        text = f"unknown key {quoted[1]!r}{around}; {one_of(quoted[1], known)}"
        return Wrong((*place, quoted[1]), text)
    if what.startswith("Object missing required field ") and quoted:
        place = _named(values, place, lambda given: quoted[1] not in given)
        around = f"{dotted(place)}: " if place else ""
        instead = _meant_for(quoted[1], found, _given(values, place))
        return Wrong(place, f"{around}the key {quoted[1]!r} is missing{instead}")
    if what.startswith("Invalid enum value "):
        given = what.removeprefix("Invalid enum value ").strip("'\"")
        place = _named(values, place, lambda one: str(one) == given)
        return Wrong(place, f"{dotted(place)} {given!r}: {one_of(given, _choices(found))}")
    if wrong := re.fullmatch(r"Expected `(.+)`, got `(\w+)`", what):
        place = _named(values, place, lambda one: type(one) is _OF_VALUES.get(wrong[2]))
        right = " or ".join(dict.fromkeys(_WORDS.get(one, one) for one in wrong[1].split(" | ")))
        given = f"{dotted(place)} {_shown(_given(values, place))}".lstrip()
        return Wrong(place, f"{given}: must be {right}")
    return Wrong(place, f"{dotted(place)}: {what[:1].lower()}{what[1:]}".removeprefix(": "))


def dotted(place: Iterable[str | int]) -> str:
    """Return a place as it is written in errors, such as `vehicles[0].role`."""
    text = ""
    for step in place:
        text += f"[{step}]" if isinstance(step, int) or step == _ANY_KEY else f".{step}"
    return text.removeprefix(".")


def undotted(text: str) -> tuple[str | int, ...]:
    """Return the place that `dotted` wrote."""
    steps = _STEP.findall(f".{text}")
    return tuple(name or (int(index) if index.isdigit() else index) for name, index in steps)


def inside(kind: type[msgspec.Struct], place: Iterable[str | int]) -> list[msgspec.inspect.Type]:
    """Return the types that a place of a struct may have."""
    found = [msgspec.inspect.type_info(kind)]
    for step in place:
        name = step if isinstance(step, str) and step != _ANY_KEY else ""
        found = [one for before in found for one in _inside(before, name)]
    return found


def _inside(around: msgspec.inspect.Type, field: str) -> list[msgspec.inspect.Type]:
    """Return the types that a field of a type may have, or its items, with those of unions."""
    match around:
        case msgspec.inspect.StructType() if field:
            found = [one.type for one in around.fields if one.encode_name == field]
        case msgspec.inspect.VarTupleType() if not field:
            found = [around.item_type]
        case msgspec.inspect.DictType():
            found = [around.value_type]
        case _:
            found = []
    unions = (one.types if isinstance(one, msgspec.inspect.UnionType) else (one,) for one in found)
    return [one for types in unions for one in types]


def _fields(found: Iterable[msgspec.inspect.Type]) -> Iterator[msgspec.inspect.Field]:
    for one in found:
        if isinstance(one, msgspec.inspect.StructType):
            yield from one.fields


def _choices(found: Iterable[msgspec.inspect.Type]) -> list[str]:
    literals = (one for one in found if isinstance(one, msgspec.inspect.LiteralType))
    return [str(value) for literal in literals for value in literal.values]


def _meant_for(missing: str, found: Iterable[msgspec.inspect.Type], given: Any) -> str:
    """Return which key was written that may have been meant for a missing one."""
    if not isinstance(given, dict):
        return ""
    known = {field.encode_name for field in _fields(found)}
    near = meant(missing, set(given) - known)
    return f"; there is {near.removeprefix('did you mean ').strip('? ')!r}" if near else ""


def _given(values: Any, place: Iterable[str | int]) -> Any:
    for step in place:
        try:
            values = values[step]
        except (KeyError, IndexError, TypeError):
            return None
    return values


def _named(
    values: Any, place: tuple[str | int, ...], is_wrong: Callable[[Any], bool]
) -> tuple[str | int, ...]:
    """Return a place with the keys of free tables that lead to the first value that is wrong."""
    return next((at for at in _places(values, place) if is_wrong(_given(values, at))), place)


def _places(
    values: Any, place: tuple[str | int, ...], begin: int = 0
) -> Iterator[tuple[str | int, ...]]:
    """Yield every place that one with free keys may be."""
    if _ANY_KEY not in place[begin:]:
        yield place
        return
    at = place.index(_ANY_KEY, begin)
    around = _given(values, place[:at])
    for key in around if isinstance(around, dict) else ():
        yield from _places(values, (*place[:at], key, *place[at + 1 :]), at + 1)


def _shown(value: object) -> str:
    text = repr(value).replace("True", "true").replace("False", "false")
    return text if len(text) <= 40 else f"{text[:39]}…"
