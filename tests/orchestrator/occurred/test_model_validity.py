"""Whether the model held while something took place, by the drive's own gaps."""

from __future__ import annotations

import pytest

from foretwin.contracts.gap import ALARM_HORIZON_S, ALARM_LIMITS_PER_S
from foretwin.orchestrator.occurred.model_validity import model_gaps
from foretwin.sim_worker.analysis.occurred.rows import OccurredScenario

SECOND_NS = 1_000_000_000


def row(second: float, along_m: float, *, horizon_s: float = ALARM_HORIZON_S) -> dict[str, object]:
    return {
        "stamp_ns": round(second * SECOND_NS),
        "horizon_s": horizon_s,
        "along_m": along_m,
        "manoeuvre": "straight",
        "across_m": -0.1,
        "yaw_rad": 0.01,
        "yaw_rate_radps": 0.0,
        "speed_mps": 0.2,
        "accel_mps2": 0.0,
        "independent": True,
    }


def happened(begin_s: float, end_s: float) -> OccurredScenario:
    return OccurredScenario(
        kind="turn_left", begin_ns=round(begin_s * SECOND_NS), end_ns=round(end_s * SECOND_NS)
    )


def test_gaps_of_a_scenario_are_those_of_its_time_at_the_horizon_of_alarms() -> None:
    rows = [
        row(4.0, 9.0),
        row(10.0, 0.2),
        row(11.0, -0.4),
        row(12.0, 0.6),
        row(11.0, 9.0, horizon_s=5.0),
    ]

    gap, none = model_gaps([happened(10.0, 12.0), happened(30.0, 31.0)], rows)

    assert gap.samples == 3
    assert gap.along_p50_m == pytest.approx(0.4)
    assert gap.across_p95_m == pytest.approx(0.1)
    assert gap.within_limits is True
    assert gap.independent
    assert (none.samples, none.within_limits) == (0, None)


def test_one_gap_beyond_the_table_of_limits_is_enough() -> None:
    limit = ALARM_LIMITS_PER_S["along_m"] * ALARM_HORIZON_S

    (gap,) = model_gaps([happened(10.0, 12.0)], [row(10.0, 0.1), row(11.0, -limit - 0.01)])

    assert gap.within_limits is False


def test_what_unsure_states_leave_open_widens_the_limits_as_it_does_those_of_alarms() -> None:
    """Beyond 1.6 m, and within 1.6 m + 2 · 1.5 m: no alarm was raised."""
    unsure = row(10.0, 2.0) | {"along_std_m": 1.5}
    told = [model_gaps([happened(10.0, 12.0)], rows) for rows in ([unsure], [row(10.0, 2.0)])]

    assert [gap.within_limits for (gap,) in told] == [True, False]
