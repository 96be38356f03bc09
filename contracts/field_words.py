"""What the fields of a type are, in words: for files that users write, and pages about them.

The words are the docstrings below the fields, the one place that explains them.
"""

from __future__ import annotations

import ast
import functools
import inspect
import itertools
import re
import textwrap
from collections.abc import Mapping
from typing import Any, NamedTuple

import msgspec
import msgspec.inspect as types

from foretwin.contracts.numbers import FUTURE_NUMBERS

_PLAIN: dict[type[types.Type], str] = {
    types.IntType: "whole number",
    types.FloatType: "number",
    types.StrType: "text",
    types.BoolType: "true or false",
    types.BytesType: "bytes",
    types.NoneType: "nothing",
    types.AnyType: "anything",
}


_NONE = re.compile(r"(^|\. )?\bNone (is|takes|predicts|reads)\b")
"""How docstrings say what it means that a field was left out."""


class FieldWords(NamedTuple):
    """A field as its file calls it: of what kind, what where it is left out, and what it is."""

    name: str
    kind: str
    required: bool
    default: Any
    text: str
    inner: tuple[type[msgspec.Struct], ...]
    """Types of tables that it holds."""

    @property
    def shown_default(self) -> str:
        """The default as TOML, empty where there is none."""
        return "" if self.required or self.default is None else as_toml(self.default)


def fields_of(kind: type[msgspec.Struct]) -> tuple[FieldWords, ...]:
    """Return the fields of a type in their order, as they are called outside."""
    said = _docstrings(kind)
    found = types.type_info(kind)
    assert isinstance(found, types.StructType)
    words = []
    for field in found.fields:
        default = field.default
        if callable(field.default_factory):  # else there is none
            default = field.default_factory()
        words.append(
            FieldWords(
                name=field.encode_name,
                kind=_kind(field.type),
                required=field.required,
                default=None if default is msgspec.NODEFAULT else default,
                text=_NONE.sub(_left_out, said.get(field.name, "")),
                inner=tuple(structs_in(field.type)),
            )
        )
    return tuple(words)


def structs_in(kind: types.Type) -> list[type[msgspec.Struct]]:
    """Return the types of tables that a value of some type may hold, in their order."""
    match kind:
        case types.StructType():
            return [kind.cls]
        case types.UnionType():
            return [one for part in kind.types for one in structs_in(part)]
        case types.VarTupleType():
            return structs_in(kind.item_type)
        case types.TupleType():
            return [one for part in kind.item_types for one in structs_in(part)]
        case types.DictType():
            return structs_in(kind.value_type)
    return []


def tables_of(kind: type[msgspec.Struct]) -> list[type[msgspec.Struct]]:
    """Return a type and all that its fields hold, each once, the outer ones first."""
    found = [kind]
    for one in found:  # which grows
        found += [
            inner
            for field in fields_of(one)
            for inner in dict.fromkeys(field.inner)
            if inner not in found
        ]
    return list(dict.fromkeys(found))


def summary_of(kind: type) -> str:
    """Return the docstring of a type as one paragraph of text."""
    return " ".join(inspect.cleandoc(kind.__doc__ or "").split())


def as_toml(value: object) -> str:
    """Return a default as it is written in TOML."""
    match value:
        case bool():
            return "true" if value else "false"
        case str():
            return f'"{value}"'
        case int() | float():
            return f"{value}"
        case msgspec.Struct():
            pairs = ((name, getattr(value, name)) for name in value.__struct_fields__)
            text = ", ".join(f"{name} = {as_toml(one)}" for name, one in pairs if one is not None)
            return f"{{ {text} }}" if text else "{}"
        case Mapping():
            return "{" + ", ".join(f"{key} = {as_toml(one)}" for key, one in value.items()) + "}"
        case tuple():
            return f"[{', '.join(map(as_toml, value))}]"
    return str(value)


def _left_out(found: re.Match[str]) -> str:
    begins = found[1] is not None
    return f"{found[1] or ''}{'Left' if begins else 'left'} out, it {found[2]}"


def _kind(kind: types.Type) -> str:
    match kind:
        case types.LiteralType():
            return " or ".join(as_toml(value) for value in kind.values)
        case types.UnionType():
            parts = [part for part in kind.types if not isinstance(part, types.NoneType)]
            return " or ".join(dict.fromkeys(map(_kind, parts)))
        case types.VarTupleType():
            return f"list of {_kind(kind.item_type)}"
        case types.TupleType():
            return f"list of {len(kind.item_types)}: {', '.join(map(_kind, kind.item_types))}"
        case types.DictType():
            return f"table of {_kind(kind.value_type)}"
        case types.StructType():
            return f"table {kind.cls.__name__}"
        case types.CustomType():
            return getattr(kind.cls, "__name__", "array")
    return _PLAIN.get(type(kind), type(kind).__name__.removesuffix("Type").lower())


@functools.cache
def _docstrings(kind: type) -> Mapping[str, str]:
    """Return what stands below the fields of a class and of those that it extends."""
    found: dict[str, str] = {}
    for one in reversed(kind.__mro__):
        if not issubclass(one, msgspec.Struct) or one is msgspec.Struct:
            continue
        try:
            tree = ast.parse(textwrap.dedent(inspect.getsource(one)))
        except (OSError, TypeError):  # made of a table, not written as a class
            tree = ast.Module([], [])
        for node in tree.body[:1]:
            body = node.body if isinstance(node, ast.ClassDef) else []
            for field, after in itertools.pairwise(body):
                if (
                    isinstance(field, ast.AnnAssign)
                    and isinstance(field.target, ast.Name)
                    and isinstance(after, ast.Expr)
                    and isinstance(after.value, ast.Constant)
                ):
                    found[field.target.id] = " ".join(str(after.value.value).split())
    for name, row in FUTURE_NUMBERS.items():
        if name in getattr(kind, "__struct_fields__", ()):
            found.setdefault(name, f"{row.meaning[0].upper()}{row.meaning[1:]}.")
    return found
