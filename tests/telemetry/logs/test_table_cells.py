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
