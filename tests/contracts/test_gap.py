"""What a gap may lose before it is an alarm, as docs/gap.md says."""

from __future__ import annotations

import pytest

from foretwin.contracts.gap import (
    ALARM_HORIZON_S,
    ALARM_LIMITS_PER_S,
    GapSample,
    limits_after,
)
from tests.pages import page


def test_the_page_tells_the_limits() -> None:
    along, across, yaw, speed = (
        ALARM_LIMITS_PER_S[name] for name in ("along_m", "across_m", "yaw_rad", "speed_mps")
    )
    assert (
        f"An alarm is raised when, after {ALARM_HORIZON_S:g} s, two runs in a row lose more per "
        f"second than {along:g} m along, {across:g} m across, {yaw:g} rad or {speed:g} m/s"
    ) in page("gap.md")
    assert len(ALARM_LIMITS_PER_S) == 4


def sample(*, across_m: float, horizon_s: float = 2.0, across_std_m: float = 0.0) -> GapSample:
    return GapSample(
        vehicle_id="car", stamp_ns=1, horizon_s=horizon_s, manoeuvre="curve", along_m=0.0,
        across_m=across_m, yaw_rad=0.0, yaw_rate_radps=0.0, speed_mps=0.0, accel_mps2=0.0,
        independent=True, across_std_m=across_std_m,
    )  # fmt: skip


def test_limits_grow_with_the_time_that_a_model_was_left_alone_from_the_alarms_on() -> None:
    for name, per_s in ALARM_LIMITS_PER_S.items():
        # A heading that is lost leads aside by more from second to second; so does speed.
        grows = 4.0 if name in ("along_m", "across_m") else 1.0
        assert limits_after(8.0)[name] == pytest.approx(8.0 * per_s * grows)
        assert limits_after(0.1)[name] == limits_after(ALARM_HORIZON_S)[name]


def test_a_gap_is_beyond_its_limits_on_either_side() -> None:
    assert not sample(across_m=0.99).beyond_limits
    assert sample(across_m=1.01).beyond_limits
    assert sample(across_m=-1.01).beyond_limits
    assert not sample(across_m=3.99, horizon_s=4.0).beyond_limits
    assert sample(across_m=4.01, horizon_s=4.0).beyond_limits


def test_what_states_leave_open_widens_the_limits() -> None:
    """By two standard deviations."""
    unsure = sample(across_m=1.39, across_std_m=0.2)
    assert unsure.limits["across_m"] == pytest.approx(1.0 + 2.0 * 0.2)
    assert sample(across_m=1.41, across_std_m=0.2).beyond_limits
    assert unsure.limits["yaw_rad"] == limits_after(2.0)["yaw_rad"]
    assert not unsure.beyond_limits
