"""The numbers of one future: its own and those that its scenario draws, joined by the table."""

from __future__ import annotations

from collections.abc import Sequence

from foretwin.contracts.errors import UserError
from foretwin.contracts.futures import Future
from foretwin.contracts.numbers import FUTURE_NUMBERS, NEUTRAL, out_of_range
from foretwin.contracts.scenario import FAULTS

_FAULT_NUMBERS = {f"{FAULTS}.{name}": name for name in FUTURE_NUMBERS}
"""Numbers by what a scenario that draws them calls them."""


def changed_numbers(future: Future) -> dict[str, float]:
    """Return the numbers that a future or its scenario sets, by name: both joined, and held within
    their ranges.

    Raises UserError for a name that the table lacks and for an own value that is out of range.
    """
    own, drawn = future.numbers, future.values if future.scenario_id else {}
    if unknown := own.keys() - FUTURE_NUMBERS.keys():
        raise UserError(
            f"future {future.name!r} has a number {min(unknown)!r}; known: "
            f"{', '.join(FUTURE_NUMBERS)}"
        )
    for name, value in own.items():
        if wrong := out_of_range(name, value, value):
            raise UserError(f"future {future.name!r}: {name} {wrong}")
    theirs = {_FAULT_NUMBERS[key]: drawn[key] for key in drawn.keys() & _FAULT_NUMBERS.keys()}
    rows = FUTURE_NUMBERS
    return own | {
        name: rows[name].joined(value, own.get(name, rows[name].neutral))
        for name, value in theirs.items()
    }


def numbers_of(future: Future) -> dict[str, float]:
    """Return all numbers of a future by name; see `changed_numbers`."""
    return dict(NEUTRAL) | changed_numbers(future)


def check_futures(futures: Sequence[Future]) -> None:
    """Raise UserError for two futures of one index, and what `changed_numbers` raises."""
    indices = [future.index for future in futures]
    if twice := sorted({index for index in indices if indices.count(index) > 1}):
        raise UserError(f"futures: two of index {twice[0]}; each needs one of its own")
    for future in futures:
        changed_numbers(future)
