"""A table by each clock and in each frame that moves as a car does, and which is plainest."""

from __future__ import annotations

from typing import NamedTuple

from foretwin.telemetry.logs.declare.choice import Chosen, CountryOf, OpenQuestion, chosen_place
from foretwin.telemetry.logs.declare.clock import ClockColumn, clocks_of
from foretwin.telemetry.logs.declare.loose_table import LooseTable
from foretwin.telemetry.logs.declare.names import epsg_of
from foretwin.telemetry.logs.declare.places import Place, in_grid, places_of
from foretwin.telemetry.logs.declare.sensors import FoundSensors, columns_beside, sensors_of
from foretwin.telemetry.logs.log import LogError

_CLOCKS_TRIED = 4
_BY_CHANCE = ("local", "wgs84", "projected", "ecef")
"""Frames, that which columns fit by chance first."""
_PROVED_LEFT = 0.05
"""So little of a speed stays unexplained by the positions' distance where all holds."""


class Reading(NamedTuple):
    """A table by one clock in one unit: what positions it leaves, and the sensors beside them."""

    clock: ClockColumn
    frame: str
    chosen: Chosen
    sensors: FoundSensors | None

    @property
    def plainness(self) -> tuple[int, int]:
        """How many sensors go with the positions; then, how unlikely their frame is by chance."""
        found = self.sensors
        fits = -1 if self.chosen.place is None and self.chosen.question is None else 0
        if found is not None:
            fits = len(found.fits) + (found.heading is not None)
        return fits, _BY_CHANCE.index(self.frame)

    @property
    def is_proved(self) -> bool:
        """Whether a column is the speed of these positions by this time, and little else."""
        speed = None if self.sensors is None else self.sensors.fits.get("speed.forward")
        return speed is not None and speed.like.left < _PROVED_LEFT


def unit_of_time(readings: list[Reading]) -> OpenQuestion | None:
    """Return what to ask where a time moves the car as cars do in several units, and as plainly."""
    plainest = [one for one in readings if one.plainness == readings[0].plainness]
    found = dict.fromkeys(one.clock.unit for one in plainest)
    if len(found) < 2:
        return None
    text = f"{plainest[0].clock.column} may count in several units: in which does it?"
    return OpenQuestion("time_unit", text, tuple(found))


def _reading(
    table: LooseTable, clock: ClockColumn, places: list[Place], country_of: CountryOf | None,
    answers: dict[str, str],
) -> Reading:  # fmt: skip
    everything = columns_beside(table.columns, clock.time_s, {clock.column})
    chosen = chosen_place(places, everything, country_of=country_of, answers=answers)
    sensors = None
    if (place := chosen.place) is not None:
        without = {clock.column, *place.fields.values()}
        sensors = sensors_of(place, {n: c for n, c in everything.items() if n not in without})
    return Reading(clock, places[0].frame, chosen, sensors)


def readings_of(
    table: LooseTable, *, country_of: CountryOf | None, answers: dict[str, str]
) -> list[Reading]:
    """Return the readings of a table, the plainest first.

    Once a speed goes with the positions nearly whole no other unit is tried: none can hold as well.
    Raises LogError where no column is a time, or none are positions by it.
    """
    found: list[Reading] = []
    for clock, places in _clocks_and_places(table, answers):
        found.append(_reading(table, clock, places, country_of, answers))
        if found[-1].is_proved:
            break
    return sorted(found, key=lambda reading: reading.plainness, reverse=True)


def _clocks_and_places(
    table: LooseTable, answers: dict[str, str]
) -> list[tuple[ClockColumn, list[Place]]]:
    """Return the likeliest clock that leaves positions, in each unit in which it does."""
    clocks = clocks_of(table)
    if (named := answers.get("time")) is not None:
        clocks = [clock for clock in clocks if clock.column == named]
        if not clocks:
            raise LogError(f"{table.path}: --answer time={named}: no column that is a time")
    if (unit := answers.get("time_unit")) is not None:
        clocks = [clock for clock in clocks if clock.unit == unit]
        if not clocks:
            raise LogError(f"{table.path}: --answer time_unit={unit}: no column is a time in that")
    if not clocks:
        raise LogError(
            f"{table.path}: no column that rises as a time does (seconds to nanoseconds, or"
            f" ISO 8601 dates); columns: {', '.join([*table.columns, *table.times, *table.texts])}"
        )
    epsg = grid_of(table, answers)
    found: list[tuple[ClockColumn, list[Place]]] = []
    for clock in clocks[:_CLOCKS_TRIED]:
        if found and (clock.column, clock.base) != (found[0][0].column, found[0][0].base):
            continue
        columns = {name: column for name, column in table.columns.items() if name != clock.column}
        for places in places_of(columns, clock.time_s):
            if epsg is not None and places[0].frame == "projected":
                places = in_grid(places, epsg, clock.time_s)
            if places:
                found.append((clock, places))
    if found:
        return found
    if epsg is not None:
        raise LogError(
            f"{table.path}: no columns that lie where EPSG {epsg} is used, and move as a car does"
        )
    no_numbers = f"; no numbers stand in {table.words_of_texts}" if table.texts else ""
    raise LogError(
        f"{table.path}: no columns that move as a car does (degrees, radians, ECEF or metres, at a"
        f" time of {clocks[0].column!r} in {clocks[0].unit}): nothing to declare{no_numbers}"
    )


def grid_of(table: LooseTable, answers: dict[str, str]) -> int | None:
    """Return the EPSG code that was answered, or that a name tells; raises LogError."""
    if "epsg" in answers:
        if not answers["epsg"].isdigit():
            raise LogError(f"--answer epsg={answers['epsg']}: no number such as 32633")
        return int(answers["epsg"])
    return epsg_of(table.columns, northern=True)
