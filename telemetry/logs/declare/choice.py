"""Which of several readings of positions holds: by sensors, by the land, by names, by the user.

Turned round, latitude and longitude make a track that is mirrored and stretched: speeds and
headings do not fit it. Where nothing else was measured, names and coasts are left.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from foretwin.telemetry.logs.declare.likeness import SURE, likeness
from foretwin.telemetry.logs.declare.motion import GridMotion, on_grid
from foretwin.telemetry.logs.declare.names import called, called_alike
from foretwin.telemetry.logs.declare.places import Place
from foretwin.telemetry.logs.declare.roles import ROLES, fits_of, heading_of, without_reverse
from foretwin.telemetry.logs.declare.sensors import ChangingColumn

CountryOf = Callable[[float, float], str]
"""The country at latitude and longitude, "" at sea."""

_PLAINLY = 2.0
"""One reading leaves so many times as much unexplained as another: it does not hold."""
_SPEED = tuple(role for role in ROLES if role.section == "speed")


class OpenQuestion(NamedTuple):
    """What data cannot answer: `key` is answered by one of `choices`, or freely where empty."""

    key: str
    text: str
    choices: tuple[str, ...] = ()


class Chosen(NamedTuple):
    """A reading and why it, or the question that is left."""

    place: Place | None
    evidence: str
    question: OpenQuestion | None = None


def chosen_place(
    places: list[Place],
    sensors: dict[str, ChangingColumn],
    *,
    country_of: CountryOf | None,
    answers: dict[str, str],
) -> Chosen:
    """Return the reading that holds.

    `sensors` are all columns that change, those of positions among them.
    """
    scores = _misfits(places, sensors)
    groups = list(dict.fromkeys(frozenset(place.fields.values()) for place in places))

    def best_of(group: frozenset[str]) -> tuple[float, int]:
        mine = [row for row in zip(scores, places, strict=True)
                if frozenset(row[1].fields.values()) == group]  # fmt: skip
        return min(score for score, _ in mine), -max(len(place.rows) for _, place in mine)

    answered = {answers[key] for key in ("latitude", "x") if key in answers}
    wanted = [group for group in groups if not answered or answered & group]
    if not wanted:
        return Chosen(None, f"no column {answered.pop()!r} that positions can be in")
    wanted.sort(key=best_of)
    group = wanted[0]
    # Another receiver's columns are another reading; the same ones with a stranger are none.
    rivals = [one for one in wanted if one & group]
    if len(rivals) > 1 and best_of(rivals[1])[0] < _PLAINLY * best_of(group)[0]:
        named = {
            one: max((called(p.fields), called_alike(p.fields.values())) for p in places
                     if frozenset(p.fields.values()) == one)
            for one in rivals
        }  # fmt: skip
        rivals = [one for one in rivals if named[one] == max(named.values())]
        group = rivals[0]
        if len(rivals) > 1:
            first = next(iter(places[0].fields))
            names = sorted({place.fields[first] for place in places
                            if frozenset(place.fields.values()) in rivals})  # fmt: skip
            text = f"positions may lie in {' or in '.join(map(_listed, rivals))}: what is {first}?"
            return Chosen(None, "", OpenQuestion(first, text, tuple(names)))
    rows = [
        (score, place)
        for score, place in zip(scores, places, strict=True)
        if frozenset(place.fields.values()) == group
    ]
    others = sorted(_listed(other) for other in groups if not other & group)
    also = f"; other positions: {'; '.join(others)}" if others else ""
    chosen = _order_of(rows, sensors, country_of=country_of, answers=answers)
    return chosen._replace(evidence=chosen.evidence + also)


def _listed(group: frozenset[str]) -> str:
    return " and ".join(sorted(group))


def _order_of(
    rows: list[tuple[float, Place]], sensors: dict[str, ChangingColumn], *,
    country_of: CountryOf | None, answers: dict[str, str],
) -> Chosen:  # fmt: skip
    rows = sorted(rows, key=lambda row: row[0])
    unit, question = _unit_of(rows, country_of=country_of, answers=answers)
    if question is not None:
        return Chosen(None, "", question)
    rows = [row for row in rows if row[1].unit == unit]
    if not rows:
        return Chosen(None, f"positions cannot be in {unit!r}")
    first = next(iter(rows[0][1].fields))
    if first in answers:
        for _, place in rows:
            if place.fields[first] == answers[first]:
                return Chosen(place, f"{first} as answered")
        return Chosen(None, f"{answers[first]} cannot be {first}")
    if len(rows) == 1:
        return Chosen(rows[0][1], "the only order of these columns that is on Earth")
    if rows[0][1].motion.sparse:
        # Ways that are too short by what bends cut off come near to some unit in either order.
        whatever = [(_by_any_speed(place, sensors), place) for _, place in rows]
        if np.isfinite([score for score, _ in whatever]).any():
            rows = sorted(whatever, key=lambda row: row[0])
    if np.isfinite(rows[0][0]) and rows[0][0] * _PLAINLY < rows[1][0]:
        said = f"{rows[1][0] / rows[0][0]:.1f} times" if np.isfinite(rows[1][0]) else "not at all"
        return Chosen(
            rows[0][1],
            f"with {first} and the other turned round, what sensors say of speed and heading"
            f" fits {said}{' as badly' if np.isfinite(rows[1][0]) else ''}",
        )
    if country_of is not None and rows[0][1].middle_deg is not None:
        on_land = [place for _, place in rows if _on_land(place, country_of)]
        if len(on_land) == 1:
            return Chosen(on_land[0], "the other order lies in the sea, or nowhere")
    named = sorted(((called(place.fields), place) for _, place in rows), key=lambda row: -row[0])
    if named[0][0] > named[1][0]:
        said = "by names alone: nothing in the table proves the order of its columns"
        return Chosen(named[0][1], said)
    if rows[0][1].middle_deg is None:
        # The one question that a plane leaves is where it lies.
        return Chosen(rows[0][1], "in this order by nothing but the columns' own")
    names = tuple(dict.fromkeys(place.fields[first] for _, place in rows))
    text = f"positions lie in {', '.join(rows[0][1].fields.values())}: which of them is {first}?"
    return Chosen(None, "", OpenQuestion(first, text, names))


def _unit_of(
    rows: list[tuple[float, Place]], *, country_of: CountryOf | None, answers: dict[str, str]
) -> tuple[str, OpenQuestion | None]:
    """Return in which unit columns are positions, or the question where two move as a car does."""
    best: dict[str, float] = {}
    for score, place in rows:
        best.setdefault(place.unit, score)
    if (said := answers.get("position_unit")) is not None:
        return said, None
    ranked = sorted(best, key=lambda unit: best[unit])
    if len(ranked) > 1 and best[ranked[0]] * _PLAINLY < best[ranked[1]]:
        return ranked[0], None
    if len(ranked) > 1 and country_of is not None and rows[0][1].middle_deg is not None:
        ashore = dict.fromkeys(place.unit for _, place in rows if _on_land(place, country_of))
        ranked = list(ashore) if len(ashore) == 1 else ranked
    if len(ranked) == 1:
        return ranked[0], None
    names = " and ".join(rows[0][1].fields.values())
    text = f"{names} move as a car does in several units: in which are they?"
    return "", OpenQuestion("position_unit", text, tuple(sorted(ranked)))


def _on_land(place: Place, country_of: CountryOf) -> bool:
    return bool(country_of(*(place.middle_deg or (0.0, 0.0))))


def _misfits(places: list[Place], sensors: dict[str, ChangingColumn]) -> list[float]:
    """Return what the best speed leaves unexplained with each, or else the best heading.

    Infinite where none fits.
    """
    speeds = [_by_speed(place, _beside(place, sensors)) for place in places]
    if np.isfinite(speeds).any():
        return speeds
    return [_by_heading(place, _beside(place, sensors)) for place in places]


def _beside(place: Place, sensors: dict[str, ChangingColumn]) -> dict[str, ChangingColumn]:
    return {name: column for name, column in sensors.items() if name not in place.fields.values()}


def _by_speed(place: Place, beside: dict[str, ChangingColumn]) -> float:
    return min(
        (
            max(fit.like.left, 1e-5)
            for name, column in beside.items()
            for fit in fits_of(
                place.motion, name, on_grid(place.motion, column.time_s, column.values), _SPEED
            )
        ),
        default=np.inf,
    )


def _by_any_speed(place: Place, sensors: dict[str, ChangingColumn]) -> float:
    """Return what the column that goes best with the way per time leaves, be its unit as it may."""
    speed_mps = place.motion.speed_mps[:, None]
    found = [
        likeness(without_reverse(on_grid(place.motion, *column)), speed_mps)
        for column in _beside(place, sensors).values()
    ]
    return min((one.left for one in found if one and one.chance >= SURE), default=np.inf)


def _by_heading(place: Place, beside: dict[str, ChangingColumn]) -> float:
    spreads = (_heading_spread(place.motion, name, column) for name, column in beside.items())
    return min((max(spread, 1e-5) for spread in spreads if spread is not None), default=np.inf)


def _heading_spread(motion: GridMotion, name: str, column: ChangingColumn) -> float | None:
    for turn in (2.0 * np.pi, 360.0):
        if np.ptp(column.values) < 1.3 * turn:
            angle = on_grid(motion, column.time_s, np.unwrap(column.values, period=turn))
            found = heading_of(motion, name, angle, np.arange(-16, 17, 8))
            if found is not None:
                return found.spread_rad**2
    return None
