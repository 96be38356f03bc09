"""The commands `declare` and `merge`: files written, questions asked, users told in one line."""

from __future__ import annotations

import io
import re
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from foretwin.contracts.errors import UserError
from foretwin.orchestrator.commands import declare as command
from foretwin.orchestrator.commands.cli import app
from foretwin.orchestrator.commands.recordings import merge_logs
from foretwin.telemetry.logs import open_log
from foretwin.telemetry.logs.declare.proposal import ANSWERS
from tests.telemetry.logs.declare.test_propose import drawn_drive

COVERS = ("foretwin.orchestrator.commands.recordings",)


def table(folder: Path, *, grid: bool = False, name: str = "drive.csv") -> Path:
    gnss = drawn_drive()["gnss"]
    lat, lon = gnss.columns["latitude"], gnss.columns["longitude"]
    if grid:
        lat, lon = (lat - lat[0]) * 111_195.0 + 5_330_000.0, (lon - lon[0]) * 74_000.0 + 691_000.0
    rows = zip(gnss.stamps_ns / 1e9, lat, lon, strict=True)
    path = folder / name
    path.write_text("t,lat,lon\n" + "".join(f"{t:.3f},{a:.8f},{b:.8f}\n" for t, a, b in rows))
    return path


def test_a_table_is_declared_and_read(tmp_path: Path) -> None:
    path = table(tmp_path)
    said = command.declare(path, out=None, answers=("reference_point=rear axle",)).words
    assert isinstance(said, str)
    written = (tmp_path / "drive.csv.toml").read_text()
    assert written.startswith(command.DECLARED_MARK)
    assert "by names alone" in said
    assert "steering: no column that is plainly one" in said
    log = open_log(path)
    assert log.info.reference_point == "rear axle"
    assert sum(1 for _ in log.samples()) == 1500
    command.declare(path, out=None, answers=())
    assert "unknown" in (tmp_path / "drive.csv.toml").read_text()


def test_help_names_all_that_can_be_answered() -> None:
    said = CliRunner().invoke(app, ["declare", "--help"]).stdout
    assert [key for key in ANSWERS if not re.search(rf"\b{key}\b", said)] == []


def test_what_somebody_wrote_is_kept(tmp_path: Path) -> None:
    path = table(tmp_path)
    (tmp_path / "drive.csv.toml").write_text("# mine\n")
    with pytest.raises(UserError, match="is there and not of `declare`"):
        command.declare(path, out=None, answers=())
    command.declare(path, out=tmp_path / "other.toml", answers=())
    assert (tmp_path / "drive.csv.toml").read_text() == "# mine\n"
    assert sum(1 for _ in open_log(path, declaration=tmp_path / "other.toml").samples()) == 1500


def test_without_a_terminal_the_question_is_told_and_nothing_is_written(tmp_path: Path) -> None:
    path = table(tmp_path, grid=True)
    ran = CliRunner().invoke(app, ["declare", str(path)])
    assert isinstance(ran.exception, UserError)
    assert "EPSG code" in str(ran.exception)
    assert "--answer epsg=" in str(ran.exception)
    assert not (tmp_path / "drive.csv.toml").exists()
    ran = CliRunner().invoke(app, ["declare", str(path), "--answer", "epsg=32632"])
    assert ran.exception is None
    first = next(iter(open_log(path).samples()))[1]
    assert first.position.lat_deg == pytest.approx(48.1, abs=0.1)  # type: ignore[attr-defined]


def test_at_a_terminal_it_is_asked(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    class Terminal(io.StringIO):
        def isatty(self) -> bool:
            return True

    monkeypatch.setattr("sys.stdin", Terminal("32632\n"))
    monkeypatch.setattr("sys.stdout", Terminal())
    path = table(tmp_path, grid=True)
    command.declare(path, out=None, answers=())
    assert "epsg = 32632" in (tmp_path / "drive.csv.toml").read_text()


@pytest.mark.parametrize(
    ("answers", "told"), [(("epsg",), "no KEY=VALUE"), (("a=b",), "no such question")]
)
def test_a_wrong_answer_is_told(tmp_path: Path, answers: tuple[str, ...], told: str) -> None:
    with pytest.raises(UserError, match=told):
        command.declare(table(tmp_path), out=None, answers=answers)
    with pytest.raises(FileNotFoundError, match="no such file"):
        command.declare(tmp_path / "none.csv", out=None, answers=())


SPEEDS = """
reference_point = "wheels"
[time]
column = "t"
unit = "s"
base = "boot"
[speed]
forward = { column = "v", unit = "m/s" }
"""


def two_recordings(folder: Path) -> tuple[Path, Path]:
    """The positions of a drive, declared, and its speeds by a clock that is 77.25 s ahead."""
    first = table(folder, name="gnss.csv")
    command.declare(first, out=None, answers=())
    drive = drawn_drive()["speed"]
    second = folder / "car.csv"
    rows = zip(drive.stamps_ns / 1e9 + 77.25, drive.columns["forward"], strict=True)
    second.write_text("t,v\n" + "".join(f"{t:.3f},{v:.4f}\n" for t, v in rows))
    (folder / "car.csv.toml").write_text(SPEEDS)
    return first, second


def test_two_recordings_become_one(tmp_path: Path) -> None:
    first, second = two_recordings(tmp_path)
    drive = drawn_drive()["speed"]
    said = merge_logs(first, second, tmp_path / "both.mcap").words
    assert isinstance(said, str)
    assert "its clock says 77.2" in said
    assert "taken from" in said
    assert "speed" in said
    both = open_log(tmp_path / "both.mcap")
    speeds = [(m.stamp_ns * 1e-9, m.speed_mps) for name, m in both.samples() if name == "speed"]  # type: ignore[attr-defined]
    at, speed = np.array(speeds).T
    true = np.interp(at, drive.stamps_ns * 1e-9, drive.columns["forward"])
    assert np.median(np.abs(speed - true)) < 0.15


def test_a_second_that_adds_nothing_is_refused(tmp_path: Path) -> None:
    first, second = table(tmp_path), table(tmp_path, name="again.csv")
    for path in (first, second):
        command.declare(path, out=None, answers=())
    with pytest.raises(UserError, match="has nothing that"):
        merge_logs(first, second, tmp_path / "both.mcap")
    with pytest.raises(UserError, match="unknown suffix"):
        merge_logs(first, second, tmp_path / "both.txt")
