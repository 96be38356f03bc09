"""The countdown's errors, of countdowns that are known."""

from __future__ import annotations

import pytest

from tests.trust.arrivals import Shown, arrivals, departures_s, off_s, row


def approach(junction_id: str, *, off_s: float = 0.0, stood_at_s: float = -1.0) -> list[Shown]:
    """20 s towards a junction at 10 m/s, the countdown off by so much."""
    return [
        Shown(
            100.0 + tenth / 10,
            0.0 if abs(20.0 - tenth / 10 - stood_at_s) < 0.05 else 10.0,
            junction_id,
            200.0 - tenth,
            20.0 - tenth / 10 + off_s,
        )
        for tenth in range(200)
    ]


def test_what_is_off_is_said_of_each_arrival() -> None:
    both = list(arrivals(approach("a", off_s=2.0) + approach("b", off_s=-1.0)))

    assert [off_s(one, 10.0) for one in both] == pytest.approx([2.0, -1.0])
    assert max(departures_s(both[0])) == pytest.approx(0.0, abs=1e-9)
    assert "1.5 / 1.9" in row("x", both) or "1.5 / 2.0" in row("x", both)


def test_a_junction_that_is_not_reached_is_no_arrival() -> None:
    assert list(arrivals(approach("a")[:150] + approach("b"))) == [approach("b")]


def test_an_arrival_after_a_stop_does_not_count() -> None:
    (one,) = arrivals(approach("a", stood_at_s=7.0))

    assert off_s(one, 10.0) is None
    assert off_s(one, 5.0) == pytest.approx(0.0)
