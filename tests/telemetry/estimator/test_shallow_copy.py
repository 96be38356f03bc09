"""A copy of a filter goes on by itself, and shares what it does not replace."""

from __future__ import annotations

from foretwin.telemetry.estimator.shallow_copy import shallow_copy


class Filter:
    """One number, and what it has seen."""

    def __init__(self) -> None:
        self.value, self.seen = 1.0, [1.0]


def test_a_copy_changes_alone_and_shares_what_it_holds() -> None:
    first = Filter()
    other = shallow_copy(first)
    other.value = 2.0

    assert (first.value, other.value) == (1.0, 2.0)
    assert other.seen is first.seen
