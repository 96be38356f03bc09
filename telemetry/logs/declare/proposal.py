"""A declaration of a table, from what its columns do: found, with its evidence, or left open."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from foretwin.contracts.arrays import Array
from foretwin.contracts.did_you_mean import one_of
from foretwin.telemetry.logs.declaration import Declaration, PositionSection, TimeSection
from foretwin.telemetry.logs.declare.choice import Chosen, CountryOf, OpenQuestion
from foretwin.telemetry.logs.declare.clock import ClockColumn
from foretwin.telemetry.logs.declare.loose_table import LooseTable, read_loose_table
from foretwin.telemetry.logs.declare.motion import GRID_S
from foretwin.telemetry.logs.declare.names import altitude_of, std_of
from foretwin.telemetry.logs.declare.places import Place
from foretwin.telemetry.logs.declare.rasters import check_one_time, without_copies
from foretwin.telemetry.logs.declare.readings import grid_of, readings_of, unit_of_time
from foretwin.telemetry.logs.declare.repeats import new_when, same_source
from foretwin.telemetry.logs.declare.sections import Sections, col
from foretwin.telemetry.logs.declare.sensors import FoundSensors
from foretwin.telemetry.logs.log import LogError

ANSWERS = {
    "time": "the column of the rows' time",
    "time_unit": "the unit of that time, such as ms",
    "latitude": "the column of latitudes",
    "position_unit": "the unit of positions, such as 1e-7 deg or km",
    "x": "the column of x, of ECEF or of a plane",
    "epsg": "the code of a projected system, such as 32633",
    "origin": "LATITUDE,LONGITUDE of a plane's zero",
    "reference_point": "what on the car the positions are of",
}
"""What a user may answer beforehand, by key."""
_LATE_S = 2.0
"""Rows that come so late, and no later, are put in order as they are read."""
_UNKNOWN_POINT = "unknown: positions do not tell what on the car they are of"


@dataclass(frozen=True, kw_only=True)
class Proposal:
    """A declaration, `evidence` by its sections, and what stays `unknown`, in a line each.

    Or the one `question` without whose answer there is none.
    """

    declaration: Declaration | None
    evidence: dict[str, list[str]] = field(default_factory=dict)
    unknown: list[str] = field(default_factory=list)
    question: OpenQuestion | None = None


@np.errstate(over="ignore", invalid="ignore", divide="ignore")
def propose(
    path: Path, *, answers: dict[str, str] | None = None, country_of: CountryOf | None = None
) -> Proposal:
    """Propose the declaration of a table.

    Raises LogError where the file is no table, has no time or no positions of a drive, or an answer
    does not fit. Numbers of a damaged file that are too large to reckon with are like no others.
    """
    answers = answers or {}
    for key in answers:
        if key not in ANSWERS:
            raise LogError(f"--answer {key}: no such question; {one_of(key, ANSWERS)}")
    table, copies = without_copies(read_loose_table(path))
    check_one_time(table)
    readings = readings_of(table, country_of=country_of, answers=answers)
    question = unit_of_time(readings)
    if question is not None:
        return Proposal(declaration=None, question=question)
    clock, _, chosen, sensors = readings[0]
    if chosen.question is not None:
        return Proposal(declaration=None, question=chosen.question)
    place = chosen.place
    if place is None:
        raise LogError(f"{path}: {chosen.evidence}")
    frame, question, framed = _frame(place, table, answers)
    if question is not None:
        return Proposal(declaration=None, question=question)
    assert sensors is not None
    if clock.counts and not sensors.fits and "time_unit" not in answers:
        raise LogError(
            f"{path}: column {clock.column!r} counts rows, and no other is their time: nothing says"
            f" how long a row lasts; where it is a time, say --answer time_unit={clock.unit}"
        )
    found = _written(table, clock, chosen, frame, framed, sensors, answers)
    found.unknown.extend(f"{copy}: the same as {first}" for copy, first in copies.items())
    return found


def _frame(
    place: Place, table: LooseTable, answers: dict[str, str]
) -> tuple[dict[str, Any], OpenQuestion | None, str]:
    """Return what the frame needs beside columns, or the question for it, and how it is known."""
    if place.frame == "projected":
        code = grid_of(table, answers)
        if code is not None:
            said = "as answered" if "epsg" in answers else "by a column's name alone"
            return {"epsg": code}, None, f"EPSG {code} {said}; the drive lies where that is used"
        text = "positions are eastings and northings: of which projected system (EPSG code)?"
        return {}, OpenQuestion("epsg", text), ""
    if place.frame == "local":
        if "origin" in answers:
            try:
                latitude, longitude = (float(part) for part in answers["origin"].split(","))
            except ValueError:
                raise LogError(
                    f"--answer origin={answers['origin']}: no LATITUDE,LONGITUDE"
                ) from None
            return {"origin": (latitude, longitude)}, None, "origin as answered"
        text = "positions are metres in a plane: at which LATITUDE,LONGITUDE is its zero?"
        return {}, OpenQuestion("origin", text), ""
    return {}, None, ""


def _written(
    table: LooseTable, clock: ClockColumn, chosen: Chosen, frame: dict[str, Any], framed: str,
    sensors: FoundSensors, answers: dict[str, str],
) -> Proposal:  # fmt: skip
    place = chosen.place
    assert place is not None
    sections = Sections(table.columns, clock.time_s, _speed_of_rows(place, clock.time_s))
    evidence = {"time": [_clock_said(table, clock, place)]}
    given: dict[str, Any] = {
        name: col(column, place.unit, negate=column in table.negated)
        for name, column in place.fields.items()
    }
    evidence["position"] = [_place_said(place, clock.time_s), chosen.evidence, framed]
    evidence["position"] += [
        f"{column} is negative: {table.negated[column]} says so in each row"
        for column in place.fields.values()
        if column in table.negated
    ]
    if place.frame in ("projected", "local"):
        by = "their names alone" if place.unit == "ft" else "usage alone"
        proof = "a speed fits" if "speed.forward" in sensors.fits else "nothing else tells"
        evidence["position"].append(f"in {place.unit} by {by}; {proof}")
    _add_named(given, evidence["position"], sections, place)
    told = new_when(
        list(place.fields.values()), table.columns, clock.time_s, sections.moves, places=True
    )
    if told is not None:
        given |= {"new_when": told.columns, "again_s": told.again_s}
        evidence["position"].append(told.evidence)
    position = PositionSection(frame=place.frame, **given, **frame)  # type: ignore[arg-type]
    more, said, unknown = sections.of(sensors, place)
    used = {
        clock.column,
        *(column.column for column in given.values() if hasattr(column, "column")),
    }
    used |= sections.used
    rest = [name for name in table.columns if name not in used]
    unknown += sensors.notes
    for name, text in sensors.doubts.items():
        unknown.append(f"{name}: {text}")
    left = [name for name in rest if name not in sensors.doubts]
    if left:
        unknown.append(f"not taken: {', '.join(left)}")
    back = np.fmax.accumulate(clock.time_s) - clock.time_s > _LATE_S
    if back.any():
        unknown.append(
            f"{clock.column}: {back.sum()} of {table.rows} rows are stamped earlier than rows above"
            " them, as where a table holds two cars: of these and those the fewer are left out"
        )
    if table.texts:
        unknown.append(f"no numbers, not read: {table.words_of_texts}")
    if place.frame == "local":
        x, y = place.fields.values()
        unknown.insert(0, f"position: that {x} points east and {y} north (odometry's axes do not)")
    point = answers.get("reference_point", _UNKNOWN_POINT)
    if "reference_point" not in answers:
        unknown.insert(0, "reference_point: what on the car the positions are of (antenna, box, …)")
    declaration = Declaration(
        time=TimeSection(column=clock.column, unit=clock.unit, base=clock.base, date=clock.date),
        position=position,
        reference_point=point,
        delimiter=table.layout.delimiter,
        decimal=table.layout.decimal,
        header=table.layout.header,
        skip_lines=table.layout.skip_lines,
        **more,
    )
    kept = {name: [line for line in lines if line] for name, lines in (evidence | said).items()}
    return Proposal(declaration=declaration, evidence=kept, unknown=unknown)


def _speed_of_rows(place: Place, time_s: Array) -> Array:
    """Return the speed at each row (N,), NaN beyond the positions."""
    motion = place.motion
    return np.interp(time_s, motion.time_s, motion.speed_mps, left=np.nan, right=np.nan)


def _clock_said(table: LooseTable, clock: ClockColumn, place: Place) -> str:
    steps = np.diff(clock.time_s[np.isfinite(clock.time_s)])
    steps = steps[steps > 0.0]
    return (
        f"{clock.column} in {clock.unit}: {clock.evidence}; {table.rows} rows every"
        f" {float(np.median(steps)):.4g} s in the middle, as which the car drives up to"
        f" {float(np.nanpercentile(place.motion.speed_mps, 99)):.1f} m/s"
    )


def _place_said(place: Place, time_s: Array) -> str:
    lasts_s = float(time_s[place.rows[-1]] - time_s[place.rows[0]])
    way_m = float(np.nansum(place.motion.speed_mps)) * GRID_S
    where = ""
    if place.middle_deg is not None:
        where = f" around {place.middle_deg[0]:.4f}, {place.middle_deg[1]:.4f}"
    return (
        f"{len(place.rows)} positions in {lasts_s:.0f} s{where}, moving as a car does:"
        f" {way_m:.0f} m"
    )


def _add_named(given: dict[str, Any], said: list[str], sections: Sections, place: Place) -> None:
    """Add altitude and error where columns of the same receiver are called so."""
    first = list(place.fields.values())
    free = {n: v for n, v in sections.columns.items() if n not in first}
    altitude = altitude_of(free) if place.frame != "ecef" else None
    for name, column in (("altitude", altitude), ("std", std_of(free))):
        if column is None or not sections.together([*first, column]):
            continue
        if same_source(free[column], [sections.columns[one] for one in first]):
            given[name] = col(column, "m")
            said.append(f"{name}: by its name alone, its unit too; nothing in the table proves it")
