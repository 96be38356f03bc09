"""Rows sent as columns say what rows sent one by one say."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import rerun as rr

from foretwin.viewer.blueprint import drive_blueprint
from foretwin.viewer.rows import Row
from foretwin.viewer.sinks import MOST_WAITING, FileStream
from tests.viewer.readback import Recorded


def recorded(path: Path, rows: list[Row]) -> Recorded:
    file = FileStream(path, recording_id="c", title="t", blueprint=drive_blueprint())
    file.write(rows)
    file.close()
    return Recorded(path)


def test_each_row_keeps_its_instant_and_its_values(tmp_path: Path) -> None:
    count = 2 * MOST_WAITING + 7
    rows = [Row("gap/pos_m/twin", n * 10_000_000, rr.Scalars(float(n))) for n in range(count)]
    found = recorded(tmp_path / "a.rrd", rows)

    np.testing.assert_allclose(found.times_s("/gap/pos_m/twin"), 0.01 * np.arange(count))
    assert found.values("/gap/pos_m/twin", "scalars") == [[float(n)] for n in range(count)]


def test_rows_of_several_values_and_of_other_components_stay_apart(tmp_path: Path) -> None:
    rows = [
        Row("p", 0, rr.Points2D([[0, 0], [1, 1]])),
        Row("p", 1, rr.Points2D(np.zeros((0, 2)))),
        Row("p", 2, rr.Points2D([[2, 2]], labels=["two"])),
        Row("p", 3, rr.Points2D([[3, 3], [4, 4], [5, 5]])),
        Row("q", 1, rr.Scalars([1.0, 2.0])),
    ]
    found = recorded(tmp_path / "a.rrd", rows)

    places = found.values("/p", "positions")
    assert [len(place) for place in places] == [2, 0, 1, 3]
    assert places[3][2] == [5.0, 5.0]
    assert found.values("/p", "labels") == [["two"]]
    assert found.values("/q", "scalars") == [[1.0, 2.0]]


def test_what_is_cleared_was_sent_before(tmp_path: Path) -> None:
    rows = [
        Row("f/a", 5, rr.Scalars(1.0)),
        Row("f", 5, rr.Clear(recursive=True)),
        Row("f/a", 6, rr.Scalars(2.0)),
    ]
    found = recorded(tmp_path / "a.rrd", rows)

    assert found.values("/f/a", "scalars")[-1] == [2.0]
    assert [value for value in found.values("/f", "is_recursive") if value is not None] == [[True]]
