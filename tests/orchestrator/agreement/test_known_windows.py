"""Windows that outlive who knew them: the same rows are judged alike, and the same ones stay."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from foretwin.orchestrator.agreement import known_windows
from foretwin.orchestrator.agreement.known_windows import (
    TABLE,
    ThinnedWindows,
    into_table,
    kept_windows,
)
from foretwin.orchestrator.agreement.windows import judge_in
from foretwin.orchestrator.record.results import ResultTables
from tests.orchestrator.agreement.test_windows import VEHICLE, WORLD, driven

JUDGED = driven(others=True).judged


def test_windows_of_a_table_are_judged_as_those_that_were_written(tmp_path: Path) -> None:
    tables = ResultTables(tmp_path, {})
    keep = into_table(tables.add, VEHICLE)
    for one in JUDGED:
        keep(one.window)
    tables.add(TABLE, [{"round_id": 1, "stamp_ns": 1, "window": b"of another foretwin"}])
    tables.close()

    found = kept_windows(tmp_path)
    assert [window.round_id for window in found.windows] == [o.window.round_id for o in JUDGED]
    again = judge_in(WORLD, list(found.windows), VEHICLE)
    for one, other in zip(JUDGED, again, strict=True):
        assert (one.outcome, one.gap_along_m) == (other.outcome, other.gap_along_m)
        assert one.flips == other.flips
        np.testing.assert_array_equal(one.window.driven, other.window.driven)
    assert kept_windows(tmp_path / "nothing").windows == ()


def test_whoever_takes_the_same_windows_keeps_the_same(monkeypatch: Any) -> None:
    monkeypatch.setattr(known_windows, "MOST_WINDOWS", 4)
    first, second = ThinnedWindows(), ThinnedWindows()
    went = [first.take(one.window) for one in JUDGED[:6]]
    for one in JUDGED[:6]:
        second.take(one.window)
    assert went == [False, False, False, True, False, True]
    assert [w.round_id for w in first.kept] == [w.round_id for w in second.kept]
    assert first.every_ns == second.every_ns == 4_000_000_000
