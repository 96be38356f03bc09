"""What is wrong with a user's values is said by key, with what would be right."""

from __future__ import annotations

from typing import Annotated, Any, Literal

import msgspec
import pytest

from foretwin.contracts.type_words import Wrong, dotted, in_words, inside, undotted


class Wheel(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    radius_m: float
    side: Literal["left", "right"] = "left"


class Axle(msgspec.Struct, frozen=True):
    value: float


class Waggon(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    name: str
    seats: int = 2
    open: bool = False
    wheels: tuple[Wheel, ...] = ()
    load: dict[str, float] = {}
    spare: Wheel | float | None = None
    axle: Axle | None = None
    brakes: dict[str, Wheel] = {}
    weight_kg: Annotated[int, msgspec.Meta(ge=0)] = 0


@pytest.mark.parametrize(
    ("values", "place", "text"),
    [
        ({}, (), "the key 'name' is missing"),
        (
            {"name": "x", "axle": {"vlaue": 1.0}},
            ("axle",),
            "axle: the key 'value' is missing; there is 'vlaue'",
        ),
        (
            {"name": "x", "seat": 3},
            ("seat",),
            "unknown key 'seat'; did you mean seats? "
            "one of name, seats, open, wheels, load, spare, axle, brakes, weight_kg",
        ),
        ({"name": 3}, ("name",), "name 3: must be a text in quotes"),
        ({"name": "x", "seats": 2.5}, ("seats",), "seats 2.5: must be a whole number"),
        ({"name": "x", "open": "no"}, ("open",), "open 'no': must be true or false"),
        ({"name": "x", "seats": True}, ("seats",), "seats true: must be a whole number"),
        (
            {"name": "x", "wheels": [{"radius_m": 1}, {"radius_m": 1, "side": "rihgt"}]},
            ("wheels", 1, "side"),
            "wheels[1].side 'rihgt': did you mean right? one of left, right",
        ),
        (
            {"name": "x", "wheels": [{"side": "left"}]},
            ("wheels", 0),
            "wheels[0]: the key 'radius_m' is missing",
        ),
        (
            {"name": "x", "spare": {"radius_m": 1, "sied": "left"}},
            ("spare", "sied"),
            "unknown key 'sied' in spare; did you mean side? one of radius_m, side",
        ),
        (
            {"name": "x", "spare": "y"},
            ("spare",),
            "spare 'y': must be a number or a table or nothing",
        ),
        ({"name": "x", "wheels": 3}, ("wheels",), "wheels 3: must be a list"),
        (
            {"name": "x", "load": {"coal": 1.0, "...": 2.0, "iron": "y"}},
            ("load", "iron"),
            "load.iron 'y': must be a number",
        ),
        (
            {"name": "x", "brakes": {"air": {"radius_m": 1.0}, "hand": {"side": "left"}}},
            ("brakes", "hand"),
            "brakes.hand: the key 'radius_m' is missing",
        ),
        (
            {"name": "x", "brakes": {"air": {"radius_m": 1.0}, "hand": {"radius_m": True}}},
            ("brakes", "hand", "radius_m"),
            "brakes.hand.radius_m true: must be a number",
        ),
        (
            {"name": "x", "brakes": {"a": {"radius_m": 1.0}, "b": {"radius_m": 1.0, "rad": 1}}},
            ("brakes", "b", "rad"),
            "unknown key 'rad' in brakes.b; did you mean radius_m? one of radius_m, side",
        ),
        (
            {"name": "x", "brakes": {"a": {"radius_m": 1.0, "side": "up"}}},
            ("brakes", "a", "side"),
            "brakes.a.side 'up': one of left, right",
        ),
        ({"name": "x", "weight_kg": -1}, ("weight_kg",), "weight_kg: expected `int` >= 0"),
        (7, (), "7: must be a table"),
        ({"name": "x", "open": "y" * 38}, ("open",), f"open '{'y' * 38}': must be true or false"),
        (
            {"name": "x" * 5, "open": "y" * 39},
            ("open",),
            f"open '{'y' * 38}…: must be true or false",
        ),
    ],
)
def test_what_is_wrong_is_said_by_key(values: Any, place: tuple[str | int, ...], text: str) -> None:
    with pytest.raises(msgspec.ValidationError) as caught:
        msgspec.convert(values, Waggon)
    found = in_words(caught.value, Waggon, values)
    assert found == Wrong(place, text)


def test_a_place_reads_as_it_was_written() -> None:
    assert dotted(("vehicles", 0, "role")) == "vehicles[0].role"
    assert undotted("vehicles[0].role") == ("vehicles", 0, "role")


def test_a_place_has_the_types_that_it_may_have() -> None:
    def names(*place: str | int) -> list[str]:
        return [type(one).__name__ for one in inside(Waggon, place)]

    assert names() == ["StructType"]
    assert names("seats") == ["IntType"]
    assert names("wheels") == ["VarTupleType"]
    assert names("wheels", 0) == names("wheels", "...") == ["StructType"]
    assert names("wheels", 3, "radius_m") == ["FloatType"]
    assert names("load", "coal") == names("load", "...") == ["FloatType"]
    assert set(names("spare")) == {"StructType", "FloatType", "NoneType"}
    assert names("spare", "side") == ["LiteralType"]
    assert names("seats", "x") == names("nothing") == names(0) == []
    assert dotted(("load", "...", "x")) == "load[...].x"
