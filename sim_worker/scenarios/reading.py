"""Scenarios from TOML files, checked, and the catalogue that comes with foretwin."""

from __future__ import annotations

import functools
import re
from collections.abc import Iterator
from pathlib import Path
from typing import get_args

import msgspec

from foretwin.contracts.did_you_mean import one_of
from foretwin.contracts.errors import UserError
from foretwin.contracts.numbers import MAX_SEED, out_of_range
from foretwin.contracts.scenario import (
    EGO,
    FAULTS,
    ActorPart,
    Distribution,
    EgoPart,
    FaultPart,
    Number,
    Relation,
    Scenario,
)
from foretwin.contracts.toml_file import read_toml

CATALOGUE = Path(__file__).with_name("catalogue")
_NAME = re.compile(r"[a-z][a-z0-9_]*")
_ON_FOOT_ONLY: frozenset[Relation] = frozenset({"crosses_exit", "crosses_entry"})


class NamedNumber(msgspec.Struct, frozen=True):
    """A number of a scenario by the name that its cases give it, such as `ego.speed_mps`."""

    name: str
    value: Number


@functools.cache
def catalogue() -> dict[str, Scenario]:
    """Return the scenarios that come with foretwin, by id, in the order of their names."""
    found = (read_scenario(path) for path in sorted(CATALOGUE.glob("*.toml")))
    return {scenario.id: scenario for scenario in found}


def find_scenario(name: Path | str) -> Scenario:
    """Return the scenario of a catalogue id or of a file that ends in .toml.

    Raises UserError for an id that the catalogue lacks, and what `read_scenario` raises.
    """
    name = str(name)
    if name.endswith(".toml"):
        return read_scenario(name)
    known = catalogue()
    if name not in known:
        raise UserError(f"no scenario {name!r}; {one_of(name, known)}, or a .toml file")
    return known[name]


def read_scenario(path: Path | str) -> Scenario:
    """Read and check one scenario file.

    Raises UserError, in one line with the file, the field and what would be right, for anything
    that is no scenario, and MissingFileError for a missing file.
    """
    return read_toml(Path(path), Scenario, what="scenario", check=check_scenario)


def numbers(scenario: Scenario) -> Iterator[NamedNumber]:
    """Yield every number that a case of the scenario has, in a fixed order."""
    parts = [
        (EGO, scenario.ego),
        *((a.name, a) for a in scenario.actors),
        (FAULTS, scenario.faults),
    ]
    for owner, part in parts:
        for field in _number_fields(type(part)):
            yield NamedNumber(f"{owner}.{field}", getattr(part, field))


@functools.cache
def _number_fields(kind: type[EgoPart | ActorPart | FaultPart]) -> tuple[str, ...]:
    return tuple(
        field.name for field in msgspec.structs.fields(kind) if Distribution in get_args(field.type)
    )


def check_scenario(scenario: Scenario) -> None:
    """Raise ValueError, naming the field and what is right, for what no case could come from."""
    if not _NAME.fullmatch(scenario.id):
        raise ValueError(f"id {scenario.id!r} must be lower-case letters, digits and _")
    for field in ("title", "shows", "source"):
        if not getattr(scenario, field).strip():
            raise ValueError(f"{field} is empty; it must say {_MEANING[field]}")
    for field in ("horizon_s", "lead_time_s"):
        value = getattr(scenario, field)
        if not 0.5 <= value <= 60.0:
            raise ValueError(f"{field} is {value:g}; it must be from 0.5 to 60")
    if scenario.lead_time_s > scenario.horizon_s:
        raise ValueError(
            f"lead_time_s {scenario.lead_time_s:g} is after the end: "
            f"it must be at most horizon_s, {scenario.horizon_s:g}"
        )
    if not 1 <= scenario.samples <= 10_000:
        raise ValueError(f"samples is {scenario.samples}; it must be from 1 to 10000")
    if not 0 <= scenario.seed <= MAX_SEED:
        raise ValueError(f"seed is {scenario.seed}; it must be from 0 to {MAX_SEED}")
    _check_actors(scenario)
    # By their place in the file, not by the actor's name: only so does the error tell the line.
    places = {actor.name: f"actors[{index}]" for index, actor in enumerate(scenario.actors)}
    for number in numbers(scenario):
        owner, field = number.name.split(".")
        _check_number(f"{places.get(owner, owner)}.{field}", number.value)


_MEANING = {
    "title": "in a few words what the scenario is",
    "shows": "what one sees when it runs",
    "source": "who defined it",
}


def _check_actors(scenario: Scenario) -> None:
    names = [actor.name for actor in scenario.actors]
    for index, actor in enumerate(scenario.actors):
        where = f"actors[{index}]"
        if not _NAME.fullmatch(actor.name):
            raise ValueError(
                f"{where}.name {actor.name!r} must be lower-case letters, digits and _"
            )
        if actor.name in (EGO, FAULTS):
            raise ValueError(f"{where}.name {actor.name!r} is taken; give it another one")
        if actor.name in names[:index]:
            raise ValueError(f"{where}.name {actor.name!r} is there twice; names must differ")
        if actor.hidden_by and (actor.hidden_by == actor.name or actor.hidden_by not in names):
            others = ", ".join(name for name in names if name != actor.name) or "none is there"
            raise ValueError(
                f"{where}.hidden_by {actor.hidden_by!r} must name another actor: {others}"
            )
        if actor.relation == "parked" and actor.conduct != "parked":
            raise ValueError(
                f"{where}.conduct {actor.conduct!r} does not go with relation 'parked'; "
                "it must be 'parked'"
            )
        if actor.relation in _ON_FOOT_ONLY and actor.kind not in ("pedestrian", "bicycle"):
            raise ValueError(
                f"{where}.kind {actor.kind!r} cannot be on a crossing; "
                "relation crosses_exit and crosses_entry take pedestrian or bicycle"
            )


def _check_number(name: str, value: Number) -> None:
    field = name.split(".")[-1]
    if isinstance(value, Distribution):
        _check_span(name, value)
        span = (v for v in (value.min, value.max, value.mean) if v is not None)
        given = *value.values, *span
        least, most = min(given), max(given)
    else:
        least = most = value
    if wrong := out_of_range(field, least, most):
        raise ValueError(f"{name} {wrong}")


def _check_span(name: str, span: Distribution) -> None:
    has_range = span.min is not None or span.max is not None
    normal = span.mean is not None or span.std is not None
    if span.values and (has_range or normal):
        raise ValueError(f"{name} has values and a range; it must have one of the two")
    if not (span.values or has_range or normal):
        raise ValueError(f"{name} is empty; give values, min and max, or mean and std")
    if normal and (span.mean is None or span.std is None or not span.std > 0.0):
        raise ValueError(f"{name} needs both mean and a std above 0")
    if has_range and not normal and (span.min is None or span.max is None):
        raise ValueError(f"{name} needs both min and max")
    if span.min is not None and span.max is not None and not span.min < span.max:
        raise ValueError(
            f"{name} runs from min {span.min:g} to max {span.max:g}; min must be less than max"
        )
