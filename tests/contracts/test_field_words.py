"""What a field is, is said by its docstring, its type and its default."""

from __future__ import annotations

import datetime
from typing import Any, Literal

import msgspec
import numpy as np

from foretwin.contracts.field_words import as_toml, fields_of, summary_of, tables_of


class Hub(msgspec.Struct, frozen=True):
    """What a wheel turns on."""

    bolts: int = 5


class Rim(msgspec.Struct, frozen=True, rename={"colour": "paint"}):
    """Round.

    And more.
    """

    size_in: float
    """Across,
    in inches; None is unknown."""
    colour: Literal["red", "blue"] = "red"
    hub: Hub | None = None
    """None is the usual one."""
    hubs: tuple[Hub, ...] = ()
    spokes: dict[str, float] = {}


class WideRim(Rim, frozen=True):
    """A wide one."""

    wide: bool = True
    """Whether it is."""


def test_fields_are_said_as_their_file_calls_them() -> None:
    by_name = {field.name: field for field in fields_of(WideRim)}
    assert list(by_name) == ["size_in", "paint", "hub", "hubs", "spokes", "wide"]
    assert by_name["size_in"].text == "Across, in inches; left out, it is unknown."
    assert by_name["hub"].text == "Left out, it is the usual one."
    assert [field.required for field in by_name.values()] == [True, *[False] * 5]
    assert by_name["paint"].kind == '"blue" or "red"'
    assert by_name["hubs"].kind == "list of table Hub"
    assert by_name["spokes"].kind == "table of number"
    assert by_name["wide"].shown_default == "true"
    assert by_name["hub"].shown_default == ""
    assert by_name["spokes"].shown_default == "{}"


def test_a_type_names_the_tables_in_it() -> None:
    assert tables_of(WideRim) == [WideRim, Hub]
    assert summary_of(Rim) == "Round. And more."


def test_defaults_are_written_as_toml() -> None:
    assert as_toml(Hub()) == "{ bolts = 5 }"
    assert as_toml(("a", 1.5, False)) == '["a", 1.5, false]'
    assert as_toml({"a": 1}) == "{a = 1}"


class Tools(msgspec.Struct, frozen=True):
    """In a box."""

    pair: tuple[Hub, float]
    by_name: dict[str, Hub | None]
    either: float | str | None = None
    blob: bytes = b""
    rows: tuple[int, ...] = ()
    any: Any = None
    array: np.ndarray[Any, Any] | None = None
    when: datetime.date | None = None


def test_every_type_has_its_words() -> None:
    assert {field.name: field.kind for field in fields_of(Tools)} == {
        "pair": "list of 2: table Hub, number",
        "by_name": "table of table Hub",
        "either": "number or text",
        "blob": "bytes",
        "rows": "list of whole number",
        "any": "anything",
        "array": "ndarray",
        "when": "date",
    }
    by_name = {field.name: field for field in fields_of(Tools)}
    assert by_name["pair"].inner == by_name["by_name"].inner == (Hub,)
    assert (by_name["rows"].inner, by_name["rows"].shown_default) == ((), "[]")
    assert (by_name["pair"].required, by_name["pair"].shown_default) == (True, "")
    assert tables_of(Tools) == [Tools, Hub]


def test_a_type_that_is_written_nowhere_has_no_words() -> None:
    made = msgspec.defstruct("Made", [("friction_factor", float), ("more", float)])
    texts = {field.name: field.text for field in fields_of(made)}
    assert texts == {"friction_factor": "Of the ground's friction.", "more": ""}


def test_other_defaults_are_written_too() -> None:
    assert as_toml(7) == "7"
    assert as_toml(True) == "true"
    assert as_toml(datetime.date(2026, 1, 2)) == "2026-01-02"
    assert as_toml(Tools(pair=(Hub(), 1.0), by_name={})) == (
        "{ pair = [{ bolts = 5 }, 1.0], by_name = {}, blob = b'', rows = [] }"
    )
