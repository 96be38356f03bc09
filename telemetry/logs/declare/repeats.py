"""Rows that repeat a sensor's old value: what tells a new one."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from foretwin.contracts.arrays import Array, Flags
from foretwin.telemetry.logs.declare.motion import changes

_NEW_OFTEN, _PLACES_NEW = 0.75, 0.97
"""So many of its rows change while the car moves where a sensor is new in each; of positions more,
which nothing rounds to the same."""
_ALL_NEW, _AS_FEW = 0.99, 1.5
_FEW = 50
_SAME = 0.9


class NewWhen(NamedTuple):
    """What a section's `new_when` and `again_s` say, and why."""

    columns: tuple[str, ...]
    again_s: float
    evidence: str


def new_when(
    section: list[str],
    columns: dict[str, Array],
    time_s: Array,
    moves: Flags,
    *,
    places: bool = False,
) -> NewWhen | None:
    """Return how new values of a section's columns are told, None where each row has new ones.

    `moves` (N,) are the rows in which the car moves. A counter is looked for that changes with
    them; without one it is themselves that change, and what stands for longer is new again.
    """
    mine = [columns[name] for name in section]
    known = np.all([np.isfinite(column) for column in mine], axis=0)
    changed = np.zeros(len(known), dtype=bool)
    changed[changes(mine)] = True
    driving = known & moves
    share = float(changed[driving].mean()) if driving.any() else 1.0
    if share > (_PLACES_NEW if places else _NEW_OFTEN) or share * driving.sum() < 10:
        return None
    stands = known & ~moves
    stands = known & ~moves
    fewest, counter = _AS_FEW * share * known.sum(), ""
    for name, column in columns.items():
        if name in section:
            continue
        told = np.zeros(len(known), dtype=bool)
        told[changes([column])] = True
        # A value that stands still while the car does is no counter.
        goes_on = stands.sum() < _FEW or told[stands].mean() > 0.5 * share
        if told[changed].mean() >= _ALL_NEW and told.sum() < fewest and goes_on:
            fewest, counter = float(told.sum()), name
    repeats = f"{1.0 - share:.0%} of its rows repeat the row before while the car moves"
    if counter:
        return NewWhen((counter,), 0.0, f"{repeats}; {counter} changes with what is new")
    rows = np.flatnonzero(changed & moves)
    every_s = float(np.median(np.diff(time_s[rows])))
    return NewWhen(tuple(section), round(2.0 * every_s, 3), f"{repeats}; new every {every_s:.3g} s")


def same_source(column: Array, others: list[Array]) -> bool:
    """Tell whether a column changes where others do, as one of the same receiver must."""
    changed = changes([column])
    told = np.zeros(len(column), dtype=bool)
    told[changes(others)] = True
    return len(changed) < 3 or float(told[changed[1:]].mean()) >= _SAME
