"""Cells of damaged tables: told in a line, never as an error of ours."""

from __future__ import annotations

from pathlib import Path

import pytest

from foretwin.telemetry.logs import LogError
from foretwin.telemetry.logs.table_cells import read_cells


@pytest.mark.parametrize("header", [True, False])
def test_a_quotation_mark_that_is_never_closed_is_told(tmp_path: Path, header: bool) -> None:
    path = tmp_path / "drive.csv"
    path.write_text('"t,v\n' + "1.0,2.0\n" * 20_000)
    with pytest.raises(LogError, match=r"drive\.csv: .*quotation mark may be opened"):
        read_cells(path, wanted=["c1"], declared_in="x", delimiter=",", header=header)
    path.write_text("t,v\n" + "1.0,2.0\n" * 9 + '"1.0,2.0\n' + "1.0,2.0\n" * 20_000)
    with pytest.raises(LogError, match=r"drive\.csv: .*quotation mark may be opened"):
        read_cells(path, wanted=["t"], declared_in="x", delimiter=",", header=True)


@pytest.mark.parametrize("row", ['2.0,"2.0,3.0', '"2.0,2.0,3.0', '2.0,2.0,"3.0'])
def test_rows_that_are_lost_in_a_cell_are_counted(tmp_path: Path, row: str) -> None:
    path = tmp_path / "drive.csv"
    path.write_text(f"t,v,w\n1.0,2.0,3.0\n{row}\n" + "3.0,2.0,3.0\n" * 5)
    read = read_cells(path, wanted=["t", "w"], declared_in="x", delimiter=",", header=True)
    assert read.cells["t"][0] == "1.0"
    assert read.short_rows + len(read.cells["t"]) == 1 + 1 + 5
