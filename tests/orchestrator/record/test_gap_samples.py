"""Gaps are read as they were written, and those of runs recorded before as well."""

from __future__ import annotations

import msgspec

from foretwin.contracts.gap import GapSample
from foretwin.orchestrator.record.gap_samples import gap_samples
from foretwin.orchestrator.record.results import GAP
from foretwin.sim_worker.futures.columns import row_of

UNSURE = GapSample(
    vehicle_id="", stamp_ns=5_000_000_000, horizon_s=2.0, manoeuvre="straight", along_m=2.0,
    across_m=0.1, yaw_rad=0.01, yaw_rate_radps=0.0, speed_mps=0.2, accel_mps2=0.0,
    independent=True, along_std_m=1.5, across_std_m=0.2, yaw_std_rad=0.01, speed_std_mps=0.1,
)  # fmt: skip


def test_a_gap_comes_back_with_what_its_limits_are_of() -> None:
    (back,) = gap_samples([row_of(UNSURE, GAP)])
    assert back == UNSURE
    assert not back.beyond_limits


def test_a_run_that_says_nothing_of_uncertain_states_is_read() -> None:
    row = row_of(UNSURE, GAP)
    of_before = {name: row[name] for name in row if "_std_" not in name}
    (back,) = gap_samples([of_before])
    sure = msgspec.structs.replace(
        UNSURE, along_std_m=0.0, across_std_m=0.0, yaw_std_rad=0.0, speed_std_mps=0.0
    )
    assert back == sure
    assert back.beyond_limits
