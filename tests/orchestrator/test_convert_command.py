"""`foretwin convert` says what it wrote and what it left out."""

from __future__ import annotations

from pathlib import Path

import pytest

from foretwin.contracts.errors import UserError
from foretwin.orchestrator.commands.recordings import convert_log

COVERS = ("foretwin.orchestrator.commands.recordings",)

GOOD = "point3 {} 3784144.3 901246.3 5037714.1 0 0 0 0 0 0 0 0 0\n"


@pytest.fixture
def source(tmp_path: Path) -> Path:
    path = tmp_path / "gt.txt"
    path.write_text(GOOD.format(0) + "point3 0.5 0 0 0\n" + GOOD.format(1))
    return path


@pytest.mark.parametrize("name", ["out.mcap", "out.bag", "out.csv", "out"])
def test_it_tells_what_was_kept_and_left_out(source: Path, tmp_path: Path, name: str) -> None:
    told = convert_log(source, tmp_path / name)
    assert (tmp_path / name).exists()
    assert told.words == f"{tmp_path / name}: 2 gnss\nleft out: 1 position not finite"
    left_out = {"position not finite": 1}
    assert told.body == {
        "file": tmp_path / name,
        "samples": {"gnss": 2},
        "left_out": left_out,
    }


def test_an_unknown_kind_of_target_is_named(source: Path, tmp_path: Path) -> None:
    with pytest.raises(
        UserError, match="--to xml: no kind of target; one of mcap, ros2, ros1, csv"
    ):
        convert_log(source, tmp_path / "out", to="xml")
    convert_log(source, tmp_path / "out.data", to="csv")
    assert (tmp_path / "out.data").read_text().startswith("stamp_ns,gnss_latitude")
