"""What run.json says of how well forecasts were calibrated."""

from __future__ import annotations

import msgspec
import pytest

from foretwin.contracts.forecast import ForecastOutcome
from foretwin.orchestrator.record.forecast_count import ForecastCount
from foretwin.sim_worker.futures.columns import row_of


def outcome(share: float, *, horizon_s: float = 1.0, crps_m: float = 0.5) -> ForecastOutcome:
    return ForecastOutcome(
        round_id=0, stamp_ns=0, intersection_id="n4", horizon_s=horizon_s, travelled_m=10.0,
        p10_m=8.0, p50_m=9.5, p90_m=12.0, share=share, crps_m=crps_m, crps_table_m=0.6,
        crps_futures_m=1.0,
    )  # fmt: skip


SOME = [outcome(0.05), outcome(0.1), outcome(0.5, crps_m=0.1), outcome(0.9, horizon_s=2.0)]


def test_coverage_crps_width_and_ranks() -> None:
    count = ForecastCount()
    count.take(SOME)
    told = count.record()

    assert told is not None
    assert (told["count"], told["p10_p90_coverage"]) == (4, 0.75)
    assert told["crps"] == pytest.approx(0.4)
    assert (told["crps_uncalibrated"], told["crps_table"]) == (1.0, 0.6)
    assert (told["p10_p90_width_m"], told["median_error_m"]) == (4.0, 0.5)
    assert told["rank_histogram"] == [0.25, 0.25, 0, 0, 0, 0.25, 0, 0, 0, 0.25]
    assert told["by_horizon_s"]["2"]["count"] == 1
    assert told["by_horizon_s"]["1"]["p10_p90_coverage"] == pytest.approx(2 / 3, abs=1e-4)


def test_rows_of_the_table_count_as_what_they_were_made_of() -> None:
    one, other = ForecastCount(), ForecastCount()
    one.take(SOME)
    other.take_rows(row_of(found) for found in SOME)

    assert one.record() == other.record()
    assert msgspec.json.encode(one.record())


def test_a_round_without_a_valid_future_is_left_out_of_what_futures_come_to() -> None:
    without = [msgspec.structs.replace(outcome(0.5, horizon_s=h), crps_futures_m=None)
               for h in (1.0, 4.0)]  # fmt: skip
    one, other = ForecastCount(), ForecastCount()
    one.take([*SOME, *without])
    other.take_rows(row_of(found) for found in [*SOME, *without])
    told = one.record()

    assert told is not None
    assert told == other.record()
    assert (told["count"], told["count_uncalibrated"], told["crps_uncalibrated"]) == (6, 4, 1.0)
    four = told["by_horizon_s"]["4"]
    assert (four["count"], four["count_uncalibrated"]) == (1, 0)
    assert (four["crps"], four["crps_uncalibrated"]) == (0.5, None)


def test_where_nothing_came_nothing_is_said() -> None:
    assert ForecastCount().record() is None
