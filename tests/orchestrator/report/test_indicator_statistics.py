"""Exact intervals against figures of tables, trends against counts where chance is plain."""

from __future__ import annotations

import pytest

from foretwin.orchestrator.report.indicator_statistics import (
    CountedEvents,
    adjusted_p,
    change_p,
    rate_of,
    share_of,
    trend_of,
)


def drives(*events: int, exposure: float = 10.0) -> list[CountedEvents]:
    return [CountedEvents(one, exposure) for one in events]


def test_nothing_in_ten_kilometres_may_still_be_three_in_ten_by_the_one_sided_rule() -> None:
    found = rate_of(0, 10.0)

    assert found is not None
    assert (found.value, found.low) == (0.0, 0.0)
    assert found.high == pytest.approx(0.3689, abs=1e-4)  # -ln(0.025) / 10


def test_the_interval_of_a_rate_is_that_of_the_tables_of_poisson() -> None:
    found = rate_of(10, 1.0)

    assert found is not None
    assert found.value == 10.0
    assert (found.low, found.high) == pytest.approx((4.795, 18.390), abs=1e-3)


def test_the_interval_of_a_share_is_clopper_and_pearsons() -> None:
    found = share_of(2, 20)

    assert found is not None
    assert found.value == pytest.approx(0.1)
    assert (found.low, found.high) == pytest.approx((0.01235, 0.31698), abs=1e-5)


@pytest.mark.parametrize("found", [rate_of(0, 0.0), share_of(0, 0)])
def test_without_exposure_nothing_is_said(found: object) -> None:
    assert found is None


def test_a_later_half_with_many_more_events_is_told_from_chance() -> None:
    grown, shrunk, same = drives(0, 1, 9, 8), drives(9, 8, 0, 1), drives(4, 5, 5, 4)

    for told in (grown, shrunk):
        p = change_p(told, share=False)
        assert p == pytest.approx(2 * (1 + 18) / 2**18, rel=1e-9)  # 1 or fewer of 18, two-sided
    assert change_p(same, share=False) == pytest.approx(1.0)
    assert (trend_of(grown), trend_of(shrunk)) == ("more", "fewer")


def test_more_events_in_as_much_more_driving_are_no_trend() -> None:
    told = [*drives(2, 2, exposure=10.0), *drives(20, 20, exposure=100.0)]

    p = change_p(told, share=False)

    assert p is not None
    assert p > 0.9


def test_shares_are_compared_by_fisher() -> None:
    told = drives(0, 0, 5, 5, exposure=5.0)

    assert change_p(told, share=True) == pytest.approx(2 / 184756)  # of 20 over 10


def test_of_few_drives_or_none_with_events_no_trend_is_asked() -> None:
    unexposed = CountedEvents(0, 0.0)

    assert change_p(drives(0, 0, 9), share=False) is None
    assert change_p(drives(0, 0, 0, 0), share=False) is None
    assert change_p([*drives(0, 0, 9), unexposed], share=False) is None


def test_many_tests_are_adjusted_by_holm() -> None:
    assert adjusted_p([0.03, None, 0.01, 0.02]) == pytest.approx([0.04, None, 0.03, 0.04])
    assert adjusted_p([0.9, 0.8]) == [1.0, 1.0]
