"""The countdown's errors, of countdowns that are known."""

from __future__ import annotations

import pytest

from tests.trust.arrivals import Shown, arrivals, bands, departures_s, off_s, row


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


def told(junction_id: str, early_s: float, late_s: float | None) -> list[Shown]:
    """An approach that is told to end so many seconds before and after what is shown."""
    return [
        at._replace(early_s=at.in_s - early_s, late_s=None if late_s is None else at.in_s + late_s)
        for at in approach(junction_id)
        if at.in_s is not None
    ]


def test_between_before_and_after_are_told_apart() -> None:
    found = bands([told("a", 1.0, 1.0), told("b", -1.0, 3.0), told("c", 3.0, -1.0)], 10.0)

    assert found is not None
    assert (found.held, found.before, found.after) == pytest.approx((1 / 3, 1 / 3, 1 / 3))
    assert (found.endless, found.median_s) == pytest.approx((0.0, 2.0))
    assert found.count == 3 * 19


def test_a_band_without_an_end_holds_whoever_comes_late() -> None:
    found = bands([told("a", 1.0, None)], 10.0)

    assert found is not None
    assert found.held == found.endless == 1.0
    assert "100 / 0 / 0 (19), 100, nan s" in row("x", [told("a", 1.0, None)])


def test_an_arrival_after_a_stop_counts_for_bands() -> None:
    late = [
        at._replace(time_s=at.time_s + 30.0) if at.time_s > 115.0 else at for at in told("a", 1, 1)
    ]
    found = bands([late], 10.0)

    assert found is not None
    assert (found.held, found.after) == (0.0, 1.0)


def test_without_a_band_nothing_is_said() -> None:
    assert bands([approach("a")], 10.0) is None
