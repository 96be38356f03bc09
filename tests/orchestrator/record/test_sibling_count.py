"""What run.json and the summary say of a second engine."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import spearmanr

from foretwin.contracts.siblings import Siblings
from foretwin.orchestrator.record.sibling_count import (
    MOST_PAIRS,
    SiblingCount,
    rank_correlation,
    sibling_lines,
)

CHOSEN = Siblings(engine="multibody", share=0.1)


def row(round_id: int, apart_m: float | None, which: str = "nominal", **more: Any) -> Any:
    usual = {"collided": False, "sibling_collided": False, "matters": False, "cpu_seconds": 0.1}
    return {"round_id": round_id, "which": which, "apart_4_s_m": apart_m, **usual, **more}


def counted() -> SiblingCount:
    count = SiblingCount()
    for round_id, apart_m in enumerate((0.1, 0.2, 0.3, 0.4)):
        count.take(row(round_id, apart_m))
        count.take(row(round_id, 9.0, "worst", sibling_collided=round_id == 2, matters=True))
    for round_id, error_m in enumerate((1.0, 2.0, 4.0, 3.0)):
        count.take_error(round_id, 2.0, 77.0)
        count.take_error(round_id, 4.0, error_m)
    count.dropped["share"] += 3
    return count


def test_what_run_json_says() -> None:
    assert counted().record(CHOSEN) == {
        "engine": "multibody",
        "share": 0.1,
        "rounds": 4,
        "futures": 8,
        "dropped": {"share": 3},
        "apart_m_p50": 0.25,
        "apart_m_p95": pytest.approx(0.385),
        "outcome_differs": {"nominal": 0, "worst": 1},
        "mattered": 4,
        "cpu_seconds": 0.8,
        "with_reality": {"count": 4, "rank_correlation": 0.8},
    }
    assert SiblingCount().record(Siblings()) is None


def test_the_summary_says_it_in_one_sentence() -> None:
    assert sibling_lines(counted().record(CHOSEN), 0.071) == [
        "  multibody played 4 rounds beside MuJoCo, 7.1% of a core: nominal futures 0.25 m apart "
        "after 4 s (95 % within 0.39 m), 1 of 8 futures collide on one engine alone; how far they "
        "are apart goes with the error against the drive by a rank correlation of 0.80 (4 rounds)"
    ]
    assert sibling_lines(SiblingCount().record(CHOSEN), None) == [
        "  multibody played 0 rounds beside MuJoCo"
    ]
    assert sibling_lines(None, 0.5) == []
    few = SiblingCount()
    few.take(row(0, 0.1))
    (line,) = sibling_lines(few.record(CHOSEN), None)
    assert line.endswith("0 of 1 futures collide on one engine alone"), "one round says nothing"


def test_an_answer_may_come_after_the_drive_has_shown_the_error() -> None:
    count = SiblingCount()
    count.take_error(0, 4.0, 1.5)
    count.take(row(0, 0.1))
    count.take(row(1, None))
    assert list(count.pairs) == [(0.1, 1.5)]


def test_what_has_no_partner_is_forgotten() -> None:
    count = SiblingCount()
    for round_id in range(2000):
        count.take_error(round_id, 4.0, 1.0)
    count.take(row(0, 0.1))
    count.take(row(1999, 0.1))
    assert len(count.pairs) == 1
    assert len(count._error) < 300
    assert count.pairs.maxlen == MOST_PAIRS


@given(st.lists(st.tuples(st.integers(0, 5), st.integers(0, 5)), min_size=3, max_size=20))
def test_it_is_the_rank_correlation_of_spearman(pairs: list[tuple[int, int]]) -> None:
    one, other = np.array(pairs, dtype=float).T
    ours = rank_correlation(one, other)
    if len(set(one)) == 1 or len(set(other)) == 1:
        assert ours is None
    else:
        assert ours == pytest.approx(spearmanr(one, other).statistic)


def test_two_rounds_say_nothing() -> None:
    assert rank_correlation([1.0, 2.0], [1.0, 2.0]) is None
