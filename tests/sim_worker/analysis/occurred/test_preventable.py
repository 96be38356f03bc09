"""Whether reference drivers would have prevented what a drawn drive had ahead of it."""

from __future__ import annotations

import numpy as np
import pytest

from foretwin.sim_worker.analysis.occurred.rows import OccurredScenario
from tests.sim_worker.analysis.occurred.scenes import ego_eastwards, moving, other, seen_in


def cut_in_at(gap_m: float, *, other_mps: float, ego_mps: float = 14.0) -> OccurredScenario:
    """The row of somebody slower who comes over from 2 s on, within 3 s; at 2 s it is so far ahead
    of the car, which drives on."""
    time_s = np.arange(0.0, 8.0, 0.1)
    share = np.clip((time_s - 2.0) / 3.0, 0.0, 1.0)
    y = 1.8 - 3.4 * share * share * (3.0 - 2.0 * share)
    x = -10.0 * ego_mps + 2.0 * ego_mps + 4.5 + gap_m + other_mps * (time_s - 2.0)
    ego = ego_eastwards(8.0, speed_mps=ego_mps)
    rows = seen_in(ego, other("c", np.stack([x, y], axis=1)))
    (row,) = (row for row in rows if row.kind == "cut_in")
    return row


def test_a_gentle_cut_in_is_prevented_by_both() -> None:
    row = cut_in_at(40.0, other_mps=9.0)

    assert row.careful_prevents is True
    assert row.fuzzy_prevents is True
    assert row.careful_gap_m == pytest.approx(27.0, abs=6.0)


def test_somebody_who_comes_over_right_before_the_nose_is_prevented_by_none() -> None:
    row = cut_in_at(24.0, other_mps=4.0, ego_mps=16.0)

    assert row.careful_prevents is False


def test_who_crosses_is_not_judged_by_a_motorway_model() -> None:
    rows = seen_in(ego_eastwards(), moving("b", (1.6, -1.6), (0.0, 8.0), 8.8))

    (row,) = (row for row in rows if row.other_id == "b")
    assert row.careful_prevents is None
    assert row.fuzzy_prevents is None
