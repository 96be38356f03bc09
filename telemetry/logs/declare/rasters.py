"""Columns that are no columns of their own: copies of others, and those of another rate's rows."""

from __future__ import annotations

import numpy as np

from foretwin.contracts.arrays import Array
from foretwin.telemetry.logs.declare.loose_table import LooseTable
from foretwin.telemetry.logs.log import LogError

_LEAST_ROWS = 20
_SHORTER = 0.95
"""A raster that ends has fewer rows than so many of the table's."""
_SAME_PACE = 0.02
"""A time that is told in another unit grows by a power of a thousand, within that."""


def without_copies(table: LooseTable) -> tuple[LooseTable, dict[str, str]]:
    """Return a table without columns that hold the same as another; and these, by whose copy."""
    first_of: dict[bytes, str] = {}
    copies = {}
    for name, values in table.columns.items():
        same = first_of.setdefault(values.tobytes(), name)
        if same != name and len(np.unique(values[np.isfinite(values)])) > 1:
            copies[name] = same
    kept = {name: values for name, values in table.columns.items() if name not in copies}
    return table._replace(columns=kept), copies


def check_one_time(table: LooseTable) -> None:
    """Refuse rows that are of several rates, each with a time of its own beside it.

    Then some columns end before the others, and one of them rises as a time does, at another pace
    than a rising column of those that go on: what stands in a row is not of one instant. Raises
    LogError.
    """
    ends: dict[int, list[str]] = {}
    for name, values in table.columns.items():
        known = np.flatnonzero(np.isfinite(values))
        if len(known) >= _LEAST_ROWS and known[-1] == len(known) - 1:
            ends.setdefault(len(known), []).append(name)
    whole = [name for end, names in ends.items() if end == table.rows for name in names]
    times = [name for name in whole if _rises(table.columns[name])]
    for end, names in ends.items():
        if end >= _SHORTER * table.rows or len(names) < 2:
            continue
        own = [name for name in names if _rises(table.columns[name][:end])]
        for name in own:
            if times and not any(
                _one_pace(table.columns[name][:end], table.columns[time][:end]) for time in times
            ):
                raise LogError(
                    f"{table.path}: {', '.join(names)} end at row {end} of {table.rows}, and {name}"
                    f" rises as a time does, at another pace than {' or '.join(times)}: a table has"
                    " one time; write columns of each rate into a table of their own, and `foretwin"
                    " merge` what has positions with the rest"
                )


def _rises(values: Array) -> bool:
    return bool(np.all(np.diff(values) > 0.0))


def _one_pace(values: Array, time: Array) -> bool:
    """Tell whether a rising column is a time in the same or another unit, or no time at all."""
    pace = float((values[-1] - values[0]) / (time[-1] - time[0]))
    steps = np.diff(values)
    if float(np.std(steps)) > 0.5 * float(np.mean(steps)):
        return True
    thousands = np.log10(pace) / 3.0
    return bool(abs(thousands - round(thousands)) * 3.0 * np.log(10.0) < _SAME_PACE)
