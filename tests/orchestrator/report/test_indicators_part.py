"""The section on indicators over several drives."""

from __future__ import annotations

from foretwin.orchestrator.report.blocks import Chapter, Listed, Prose
from foretwin.orchestrator.report.indicators import CoveredForecasts, DriveIndicators, Indicator
from foretwin.orchestrator.report.indicators_part import SOURCE, indicators_part

CONFLICTS = Indicator(
    name="conflicts", unit="km", junction_kind="", drives=4, events=3, exposure=150.0, value=0.02,
    low=0.004, high=0.058, p_value=0.01, trend="more",
)  # fmt: skip
LATE = Indicator(
    name="rounds too late", unit="trial", junction_kind="", drives=4, events=5, exposure=500.0,
    value=0.01, low=0.003, high=0.023, p_value=0.6, trend=None,
)  # fmt: skip


def section(drives: int = 4, replays: int = 0, *, in_order: bool = True) -> Chapter:
    return indicators_part(
        DriveIndicators(
            drives=drives,
            indicators=(CONFLICTS, LATE),
            calibration=CoveredForecasts(drives=4, forecasts=400, coverage=0.675),
            replays=replays,
            in_order=in_order,
        )
    )


def prose(chapter: Chapter) -> str:
    return "\n".join(one.text for one in chapter.blocks if isinstance(one, Prose))


def test_each_indicator_stands_with_exposure_interval_and_trend() -> None:
    (table,) = (one for one in section().blocks if isinstance(one, Listed))

    assert [[cell.text for cell in cells] for cells in table.rows] == [
        ["conflicts", "3", "150.00\u00a0km", "per 100 km", "4", "2.00", "0.40", "5.80",
         "more (p 0.01)"],
        ["rounds too late", "5", "500", "%", "4", "1.00", "0.30", "2.30", ""],
    ]  # fmt: skip
    assert table.rows[0][-1].tone == "watch"


def test_it_says_which_source_was_read_and_which_was_not() -> None:
    said = prose(section())

    assert SOURCE in said
    assert "was not read" in SOURCE
    assert "1 row differs significantly" in said
    assert "67.5 % of 400 forecasts in 4 drives" in said


def test_it_says_what_limits_what_the_figures_can_tell() -> None:
    assert "2 drives replay a recording" in prose(section(replays=2))
    assert "replay" not in prose(section())
    assert "4 drives or more" in prose(section(drives=3))
    assert "no trend is told" in prose(section(in_order=False))
