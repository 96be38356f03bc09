"""A map that moves the estimate is not taken for a gap between model and car."""

from __future__ import annotations

import pytest

from tests.sim_worker.analysis.gap.map_aided_gap import measured_gap


@pytest.mark.judge
@pytest.mark.timeout(1800)
def test_with_a_map_the_gap_of_a_telephones_states_is_smaller_and_alarms_nobody() -> None:
    without, mapped = (measured_gap(seed=2, mapped=kind) for kind in (False, True))

    assert mapped.across_m < 0.6 * without.across_m
    assert mapped.along_m < without.along_m
    assert mapped.alarms == 0
