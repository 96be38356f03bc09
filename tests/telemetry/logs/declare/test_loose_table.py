"""Whatever is given as a table is read as far as it is one, or refused in one line."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from foretwin.telemetry.logs.declare import propose
from foretwin.telemetry.logs.declare.loose_table import read_loose_table
from tests.damaged_files import read_damaged
from tests.telemetry.logs.declare.disguised import disguise
from tests.telemetry.logs.declare.test_propose import drawn_drive, one_table


@pytest.mark.parametrize("count", [5, pytest.param(12, marks=pytest.mark.judge)])
def test_damaged_tables_are_declared_or_refused_in_one_line(tmp_path: Path, count: int) -> None:
    short = drawn_drive(end_s=50.0)
    originals = [disguise(short, tmp_path, seed=seed).path for seed in (0, 3)]
    originals.append(one_table(tmp_path, v=np.full(1500, 1e308)))
    (folder := tmp_path / "damaged").mkdir()
    assert read_damaged(originals, [propose], folder=folder, count=count, seed=4) == []


def test_decimal_commas_and_missing_names_are_seen(tmp_path: Path) -> None:
    path = tmp_path / "bare.csv"
    path.write_text("1,5;2\n" * 40, encoding="utf-8")
    table = read_loose_table(path)
    assert table.layout[:3] == (";", ",", False)
    assert [column[0] for column in table.columns.values()] == [1.5, 2.0]


@pytest.mark.parametrize("end", ["", "\n", "\r\n"])
def test_a_last_line_without_its_end_is_no_row(tmp_path: Path, end: str) -> None:
    path = tmp_path / "cut.csv"
    path.write_bytes(((end or "\n").join(["1.5,2"] * 42) + end).encode())
    assert read_loose_table(path).rows == (42 if end else 41)
