"""Indicators over drives: what counts, against what, and what a drive cannot tell."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import msgspec
import pytest

from foretwin.orchestrator.occurred.occurred import Occurred
from foretwin.orchestrator.report.indicators import (
    CountedEvents,
    Indicator,
    IndicatorKey,
    RowCounts,
    counted_in,
    indicators_over,
    row_counts,
)
from foretwin.orchestrator.report.material import RunMaterial
from foretwin.sim_worker.analysis.occurred.odd import DrivenSpan, OddExposure
from foretwin.sim_worker.analysis.occurred.rows import OccurredScenario
from tests.orchestrator.report.told_runs import run_of_nothing, told_run


def scenario(junction_id: str = "", other_id: str = "", *beyond: str) -> OccurredScenario:
    return OccurredScenario(
        kind="cut_in", begin_ns=0, end_ns=1, junction_id=junction_id, other_id=other_id,
        beyond=beyond,
    )  # fmt: skip


def driven(*, sees_others: bool = True) -> Occurred:
    """7 km in half an hour, 2 km of them by software: two passes of a crossing, one of a
    roundabout, three conflicts."""
    odd = (
        OddExposure(attribute="Road", value="Minor", driven_m=3000.0, driven_s=600.0),
        OddExposure(attribute="Road", value="Distributor", driven_m=4000.0, driven_s=1200.0),
        OddExposure(attribute="Lanes", value="2", driven_m=7000.0, driven_s=1800.0),
    )
    scenarios = (
        scenario("x"), scenario("x"), scenario("x", "7", "ttc_s", "drac_mps2"),
        scenario("x", "8"), scenario("o"), scenario("", "9", "ttc_s"), scenario("o", "10", "pet_s"),
    )  # fmt: skip
    by_software = DrivenSpan(driven_m=2000.0, driven_s=360.0)
    return Occurred(scenarios=scenarios, sees_others=sees_others, odd=odd, by_software=by_software)


RECORD: dict[str, Any] = {
    "intersections": [{"id": "x", "kind": "crossing"}, {"id": "o", "kind": "roundabout"}],
    "tuning": {"gap": {"alarms": 2}, "verdicts": [{}]},
    "futures": {"late_rounds": 3, "rounds": 100},
    "ledger": {"rounds": {"due": 110, "missed": 5}, "telemetry": None, "jobs": {"lost": 0}},
}


def test_events_are_held_against_kilometres_and_hours() -> None:
    found = counted_in(RECORD, driven(), RowCounts(marked=4, takeovers=1))

    events = {
        "conflicts": 3, "conflicts by TTC": 2, "conflicts by PET": 1, "conflicts by DRAC": 1,
        "marked events": 4, "alarms of the gap": 2, "verdicts": 1,
    }  # fmt: skip
    for name, count in events.items():
        assert found[IndicatorKey(name, "km")] == CountedEvents(count, 7.0)
        assert found[IndicatorKey(name, "h")] == CountedEvents(count, 0.5)
    # Of what a human drives nobody takes over.
    assert found[IndicatorKey("takeovers", "km")] == CountedEvents(1, 2.0)
    assert found[IndicatorKey("takeovers", "h")] == CountedEvents(1, 0.1)


def test_a_note_that_came_later_is_no_second_mark() -> None:
    marks = [{"mark_id": "a"}, {"mark_id": "b"}, {"mark_id": "a", "note": "later"}]

    assert row_counts([], marks) == RowCounts(marked=2, takeovers=None)


@pytest.mark.parametrize(
    ("modes", "takeovers"),
    [
        (["autonomous", "manual", "autonomous", "manual"], 2),
        (["manual", "autonomous"], 0),
        (["unknown", "manual", "manual", "autonomous", "manual"], 1),
        (["manual"], None),  # nothing that anybody could have taken over
        (["unknown", "manual"], None),
    ],
)
def test_takeovers_are_of_what_the_software_drove(modes: list[str], takeovers: int | None) -> None:
    rows = [{"number": place, "control_mode": mode} for place, mode in enumerate(modes)]

    assert row_counts(rows[::-1], []) == RowCounts(marked=0, takeovers=takeovers)


def test_conflicts_at_junctions_are_held_against_passes_by_kind() -> None:
    found = counted_in(RECORD, driven(), RowCounts(marked=0, takeovers=None))

    assert found[IndicatorKey("conflicts", "pass", "crossing")] == CountedEvents(1, 2.0)
    assert found[IndicatorKey("conflicts", "pass", "roundabout")] == CountedEvents(1, 1.0)


def test_one_encounter_that_three_rows_tell_of_is_one_conflict() -> None:
    """A cut-in, following and the lead's braking of one car, on the way to and in a junction."""
    one = driven()
    rows = tuple(
        OccurredScenario(kind=kind, begin_ns=begin, end_ns=end, junction_id=at, other_id="a",
                         beyond=beyond)
        for kind, begin, end, at, beyond in (
            ("cut_in", 1, 5, "", ()), ("following", 3, 8, "x", ("ttc_s",)),
            ("lead_decelerates", 6, 9, "x", ("ttc_s", "drac_mps2")),
        )
    )  # fmt: skip
    occurred = msgspec.structs.replace(one, scenarios=(scenario("x"), *rows))

    found = counted_in(RECORD, occurred, RowCounts(marked=0, takeovers=None))

    assert found[IndicatorKey("conflicts", "km")] == CountedEvents(1, 7.0)
    assert found[IndicatorKey("conflicts by TTC", "km")].events == 1
    assert found[IndicatorKey("conflicts by DRAC", "km")].events == 1
    assert found[IndicatorKey("conflicts", "pass", "crossing")] == CountedEvents(1, 1.0)


def test_rounds_telemetry_and_jobs_are_shares_of_those_that_were_due() -> None:
    found = counted_in(RECORD, None, RowCounts(marked=0, takeovers=None))

    assert found == {
        IndicatorKey("rounds too late", "trial"): CountedEvents(3, 100.0),
        IndicatorKey("rounds missed", "trial"): CountedEvents(5, 110.0),
    }


def test_a_drive_in_lock_step_tells_nothing_of_rounds_in_time() -> None:
    record = RECORD | {"config": {"speed": None}}
    assert counted_in(record, None, RowCounts(marked=0, takeovers=None)) == {}


def test_a_car_that_tells_of_nobody_adds_nothing_to_the_exposure_of_conflicts() -> None:
    found = counted_in(RECORD, driven(sees_others=False), RowCounts(marked=0, takeovers=None))

    assert IndicatorKey("marked events", "km") in found
    assert not [key for key in found if key.name.startswith(("conflicts", "takeovers"))]


def of(found: tuple[Indicator, ...], name: str, unit: str) -> Indicator:
    (one,) = (one for one in found if (one.name, one.unit) == (name, unit))
    return one


def late(out: Path, number: int, late_rounds: int, **more: Any) -> RunMaterial:
    run = told_run(
        out / str(number), run_id=f"20261123-12000{number}-told", **more,
        futures={"late_rounds": late_rounds, "rounds": 50, "smaller_rounds": 0},
    )  # fmt: skip
    return RunMaterial(run)


def test_drives_are_added_and_a_trend_is_told_in_the_order_of_their_begin(tmp_path: Path) -> None:
    runs = [late(tmp_path, n, count) for n, count in ((3, 9), (0, 0), (2, 8), (1, 1))]

    found = indicators_over(runs)

    rounds = of(found.indicators, "rounds too late", "trial")
    assert (rounds.drives, rounds.events, rounds.exposure) == (4, 18, 200.0)
    assert rounds.value == pytest.approx(0.09)
    assert rounds.trend == "more"
    marked = of(found.indicators, "marked events", "km")
    assert (marked.drives, marked.events, marked.trend) == (4, 0, None)
    assert marked.exposure == pytest.approx(4 * 19.5 * 8.0 / 1e3, rel=0.05)
    assert found.replays == 4  # all of one log
    assert json.loads(msgspec.json.encode(found))["drives"] == 4


def test_a_run_given_twice_counts_once(tmp_path: Path) -> None:
    run = late(tmp_path, 0, 1)

    found = indicators_over([run, run])

    assert found.drives == 1
    assert of(found.indicators, "rounds too late", "trial").exposure == 50.0
    assert found.replays == 0


def test_without_the_times_of_all_runs_no_trend_is_told(tmp_path: Path) -> None:
    runs = [late(tmp_path, n, 10 * (n > 1)) for n in range(4)]
    nameless = RunMaterial(run_of_nothing(tmp_path))

    found = indicators_over([*runs, nameless])

    assert not found.in_order
    assert all(one.trend is None for one in found.indicators)


def test_coverage_is_weighted_by_forecasts(tmp_path: Path) -> None:
    shares = ((0.9, 100), (0.6, 300))
    runs = [
        late(tmp_path, n, 0, calibration={"p10_p90_coverage": share, "count": count})
        for n, (share, count) in enumerate(shares)
    ]

    covered = indicators_over(runs).calibration

    assert (covered.drives, covered.forecasts) == (2, 400)
    assert covered.coverage == pytest.approx(0.675)
