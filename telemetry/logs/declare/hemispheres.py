"""Letters that stand beside positions: of NMEA's tables, south and west are told by them alone."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from foretwin.contracts.arrays import Array
from foretwin.telemetry.logs.declare.names import called

_FIELDS, _PAIRS = ("latitude", "longitude"), (("N", "S"), ("E", "W"))


def negated_by_letters(
    names: Sequence[str], columns: dict[str, Array], letters: dict[str, frozenset[str]]
) -> dict[str, str]:
    """Return the columns of numbers that are south or west, by the column whose letter says so.

    `names` are all columns in their order, `letters` what stands in those that are no numbers.
    Both letters of a position have a column, each after its number, or before it if names say so.
    Numbers with a sign of their own are left alone. Raises ValueError where a letter changes on
    the way.
    """
    found = [
        [name for name, cells in letters.items() if cells and cells <= set(pair)] for pair in _PAIRS
    ]
    if any(len(one) != 1 for one in found):
        return {}
    told = [one[0] for one in found]
    beside = []
    for step in (-1, 1):
        at = [names.index(name) + step for name in told]
        if all(0 <= one < len(names) and names[one] in columns for one in at):
            beside.append([names[one] for one in at])
    if not beside:
        return {}
    numbers = max(beside, key=lambda pair: called(dict(zip(_FIELDS, pair, strict=True))))
    negated = {}
    for number, name in zip(numbers, told, strict=True):
        values = columns[number]
        if np.nanmin(values) < 0.0:
            continue
        if len(letters[name]) > 1:
            raise ValueError(
                f"column {name!r} says {' and '.join(sorted(letters[name]))}: write {number!r} with"
                " a sign, negative in the south and in the west"
            )
        if letters[name] & {"S", "W"}:
            negated[number] = name
    return negated
