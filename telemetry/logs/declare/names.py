"""What names of columns say: told as such, and given up where data say otherwise."""

from __future__ import annotations

import itertools
import re
from collections.abc import Iterable

import numpy as np

from foretwin.contracts.arrays import Array

FIELDS = {
    "latitude": re.compile(r"lat(?!er)|breite|^b$|^phi$", re.IGNORECASE),
    "longitude": re.compile(
        r"lon(?!git.*acc)|lng|l.{1,2}nge(?!.*beschl)|^l$|^lambda$", re.IGNORECASE
    ),
    "easting": re.compile(r"east|^e$|rechts|ost|^x|utm_?x|_x$", re.IGNORECASE),
    "northing": re.compile(r"north|^n$|hoch|nord|^y|utm_?y|_y$", re.IGNORECASE),
    "x": re.compile(r"^x|x$|east|^e$|ost", re.IGNORECASE),
    "y": re.compile(r"^y|y$|north|^n$|nord", re.IGNORECASE),
    "z": re.compile(r"^z|z$", re.IGNORECASE),
}  # fmt: skip
"""By field of a position: what a column of it may be called, in English and German."""
EAST = re.compile(r"(?:^|[\W_])e(?:$|[\W_\d])|east|ost(?!en)|rechts", re.IGNORECASE)
NORTH = re.compile(r"(?:^|[\W_])n(?:$|[\W_\d])|north|nord|hoch", re.IGNORECASE)
"""What says which axis a column lies along, more plainly than x and y, which change places."""
ALTITUDE = re.compile(r"alt(?!er)|h..?he|^h$|height|elev|^hgt|^z$", re.IGNORECASE)
STD = re.compile(r"std|sigma|stdev|h_?acc|accuracy|genauigkeit|^acc$|eph$", re.IGNORECASE)
FEET = re.compile(r"ft\b|feet|fu.{1,2}$", re.IGNORECASE)
EPSG = re.compile(r"epsg\D{0,3}(\d{4,5})", re.IGNORECASE)
ZONE = re.compile(r"(?:utm|zone)\D{0,2}(\d{1,2})\s*([C-X]?)", re.IGNORECASE)

COMMANDED = re.compile(
    r"command|cmd|control|ctrl|target|desired|request|demand|setpoint|soll", re.IGNORECASE
)
"""What a controller wanted, which resembles what then happened as a sensor of it does."""


def called(fields: dict[str, str]) -> int:
    """Return how well the columns of fields are called as these would be."""
    found = 0
    for field, column in fields.items():
        found += bool(field in FIELDS and FIELDS[field].search(column))
        along = 2 * (bool(EAST.search(column)) - bool(NORTH.search(column)))
        found += {"x": along, "easting": along, "y": -along, "northing": -along}.get(field, 0)
    return found


def called_alike(names: Iterable[str]) -> float:
    """Return how much of two names is the same at both ends, as of columns of one receiver."""
    one, other = sorted((name.lower() for name in names), key=len)
    before = _begins_alike(one, other)
    after = _begins_alike(one[before:][::-1], other[before:][::-1])
    return (before + after) / len(other)


def _begins_alike(one: str, other: str) -> int:
    pairs = zip(one, other, strict=False)
    return sum(1 for _ in itertools.takewhile(lambda pair: pair[0] == pair[1], pairs))


def altitude_of(columns: dict[str, Array]) -> str | None:
    """Return the column that is called an altitude and could be one in metres."""
    for name, values in columns.items():
        known = values[np.isfinite(values)]
        plausible = len(known) > 20 and known.min() > -430.0 and known.max() < 9000.0
        if ALTITUDE.search(name) and not FEET.search(name) and plausible and np.ptp(known) < 2000.0:
            return name
    return None


def std_of(columns: dict[str, Array]) -> str | None:
    """Return the column that is called an error of positions and could be one in metres."""
    for name, values in columns.items():
        known = values[np.isfinite(values)]
        if STD.search(name) and len(known) > 20 and known.min() > 0.0 and known.max() < 500.0:
            return name
    return None


def epsg_of(columns: dict[str, Array], northern: bool) -> int | None:
    """Return the code of a projected system that a column's name tells, such as `UTM33_east`."""
    for name in columns:
        if (code := EPSG.search(name)) is not None:
            return int(code[1])
        if (zone := ZONE.search(name)) is not None and 1 <= int(zone[1]) <= 60:
            south = zone[2].upper() < "N" if zone[2] else not northern
            return (32700 if south else 32600) + int(zone[1])
    return None
