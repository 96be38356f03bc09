"""One conflict, however many rows tell of it; and two, though one row lasts over both."""

from __future__ import annotations

import numpy as np
import pytest

from foretwin.sim_worker.analysis.occurred.conflicts import conflicts_of
from foretwin.sim_worker.analysis.occurred.rows import OccurredScenario
from tests.sim_worker.analysis.occurred.scenes import ego_along, other, seen_in


def row(begin_s: int, end_s: int, *beyond: str, other_id: str = "a") -> OccurredScenario:
    return OccurredScenario(
        kind="following", begin_ns=begin_s, end_ns=end_s, other_id=other_id, beyond=beyond
    )


def test_a_lead_that_cuts_in_and_brakes_hard_is_one_conflict() -> None:
    """The car at 14 m/s, 36 m behind one that comes into its lane at 11 and brakes to a stop."""
    time_s = np.arange(200) * 0.1
    its_mps = np.where(time_s < 6.0, 11.0, np.maximum(11.0 - 4.0 * (time_s - 6.0), 0.0))
    own_mps = np.where(time_s < 6.6, 14.0, np.maximum(14.0 - 5.5 * (time_s - 6.6), 0.0))
    along_m = -264.0 + np.concatenate([[0.0], np.cumsum(its_mps[:-1] * 0.1)])
    aside_m = np.interp(time_s, [0.0, 2.0, 4.5, 20.0], [1.9, 1.9, -1.6, -1.6])
    ego = ego_along(np.array([[-300.0, -1.6], [400.0, -1.6]]), own_mps)

    rows = seen_in(ego, other("a", np.column_stack([along_m, aside_m])))

    beyond = [one for one in rows if one.beyond]
    assert [one.kind for one in beyond] == ["following", "lead_decelerates"]
    assert beyond[0].ttc_s == beyond[1].ttc_s  # One moment, in both.
    assert len(conflicts_of(rows)) == len(conflicts_of(rows, by="ttc_s")) == 1
    assert conflicts_of(rows, by="pet_s") == ()


@pytest.mark.parametrize(
    ("rows", "conflicts"),
    [
        ((), 0),
        ((row(0, 9),), 0),
        ((row(0, 5, "ttc_s"), row(0, 5, "ttc_s")), 1),
        ((row(0, 5, "ttc_s"), row(5, 9, "ttc_s")), 2),
        ((row(0, 60, "ttc_s"), row(10, 12, "ttc_s"), row(50, 53, "ttc_s")), 2),
        ((row(0, 9, "ttc_s"), row(0, 9, "ttc_s", other_id="b")), 2),
        ((row(0, 9), row(2, 3, "ttc_s"), row(4, 5)), 1),
    ],
)
def test_conflicts_are_the_fewest_moments_that_explain_the_rows(
    rows: tuple[OccurredScenario, ...], conflicts: int
) -> None:
    assert len(conflicts_of(rows)) == conflicts
    assert len(conflicts_of(rows[::-1])) == conflicts


def test_one_that_passes_two_thresholds_is_one_by_each() -> None:
    rows = (row(0, 5, "ttc_s"), row(3, 9, "drac_mps2"), row(12, 14, "ttc_s"))

    found = [len(conflicts_of(rows, by=name)) for name in ("", "ttc_s", "drac_mps2", "pet_s")]

    assert found == [2, 2, 1, 0]
