"""Learning how far a car gets, from the command line."""

from __future__ import annotations

import json
import pickle
import zipfile
from pathlib import Path

import numpy as np
import pytest

from foretwin.contracts.drive import VehicleState
from foretwin.orchestrator.commands import learn_progress
from foretwin.orchestrator.commands.cli import EXIT_USER, run
from foretwin.orchestrator.forecast import learning
from foretwin.orchestrator.forecast.examples import Examples
from foretwin.orchestrator.forecast.progress_model import SHIPPED_TABLE
from foretwin.orchestrator.forecast.quantile_trees import QuantileTrees, read_trees
from tests.orchestrator.forecast.town_drives import town_states

COVERS = ("foretwin.orchestrator.commands.cli_progress",)
DECLARED = """
reference_point = "base_link"
[time]
column = "t"
unit = "s"
base = "log"
[position]
frame = "wgs84"
latitude = { column = "lat", unit = "deg" }
longitude = { column = "lon", unit = "deg" }
"""


def log_of(states: list[VehicleState], file: Path) -> Path:
    lines = ["t,lat,lon"]
    for one in states:
        place = one.position
        lines.append(f"{one.stamp_ns / 1e9:.3f},{place.lat_deg:.9f},{place.lon_deg:.9f}")
    file.write_text("\n".join(lines) + "\n")
    Path(f"{file}.toml").write_text(DECLARED)
    return file


def logs(folder: Path, *, minutes: float) -> list[Path]:
    return [
        log_of(list(town_states(seed=seed, minutes=minutes)), folder / f"drive{seed}.csv")
        for seed in (1, 2)
    ]


def test_a_table_is_learnt_checked_and_named(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    pytest.importorskip("sklearn", reason="the extra `learn` is not installed")
    monkeypatch.setattr(learning, "ROUNDS", 4)  # how well it does is asked elsewhere
    mine, other = logs(tmp_path, minutes=5.0)
    out = tmp_path / "mine.npz"

    assert run(["learn-progress", str(mine), "--out", str(out), "--check", str(other)]) == 0
    told = capsys.readouterr().out
    assert "learnt from drive1" in told
    assert "drive2" in told
    assert read_trees(out).words == {"drives": "drive1", "licence": "of the drives' owner"}


def test_the_shipped_table_is_checked_on_ones_own_drive(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    drive = logs(tmp_path, minutes=3.0)[1]

    assert run(["learn-progress", "--check", str(drive), "--json"]) == 0
    (told,) = json.loads(capsys.readouterr().out).values()
    assert 0.4 < told["p10_p90_coverage"] < 1.0
    assert told["count"] > 100


def test_drives_whose_files_are_called_alike_all_count_and_one_named_twice_counts_once(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    learnt: list[dict[str, object]] = []

    def learn(drives: dict[str, Examples], *, words: dict[str, str]) -> QuantileTrees:
        learnt.append({name: len(drive.stamp_ns) for name, drive in drives.items()})
        return read_trees(SHIPPED_TABLE)

    monkeypatch.setattr(learn_progress, "learn", learn)
    drives = []
    for seed, day in enumerate(("monday", "tuesday", "friday")):
        (tmp_path / day).mkdir()
        states = list(town_states(seed=seed + 1, minutes=0.5 + 0.25 * seed))
        drives.append(str(log_of(states, tmp_path / day / "drive.csv")))
    checks = [word for drive in drives[1:] for word in ("--check", drive)]

    out = str(tmp_path / "mine.npz")
    assert run(["learn-progress", *drives[:2], drives[0], "--out", out]) == 0
    capsys.readouterr()
    assert run(["learn-progress", *checks, "--json"]) == 0

    assert set(learnt[0]) == {"monday/drive.csv", "tuesday/drive.csv"}
    assert learnt[0]["monday/drive.csv"] != learnt[0]["tuesday/drive.csv"]
    assert set(json.loads(capsys.readouterr().out)) == {"tuesday/drive.csv", "friday/drive.csv"}


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["LOG"], "--out FILE"),
        ([], "nothing to do"),
        (["LOG", "--out", "t.npz", "--check", "LOG"], "proves nothing"),
        (["--check", "LOG", "--table", "LOG"], "no table of progress"),
        (["--check", "LOG", "--out", "t.npz"], "--out t.npz: nothing is learnt"),
        (["LOG", "--out", "t.npz", "--table", "off"], "--table off: goes with --check alone"),
        (["missing.csv", "--out", "t.npz"], "missing.csv"),
    ],
)
def test_mistakes_are_one_line(
    arguments: list[str], said: str, tmp_path: Path, capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:  # fmt: skip
    monkeypatch.chdir(tmp_path)
    log = str(logs(tmp_path, minutes=0.5)[0])

    assert run(["learn-progress", *(log if a == "LOG" else a for a in arguments)]) == EXIT_USER
    told = capsys.readouterr().err
    assert said in told.replace("\n", " ")


def no_table(kind: str, file: Path) -> None:
    """A file that is no table: a text, objects that numpy would have to unpickle, or a zip."""
    objects = np.array([{"a": 1}], dtype=object)
    if kind == "text":
        file.write_text("no table\n")
    elif kind == "pickle":
        file.write_bytes(pickle.dumps({"version": 1}))
    elif kind == "array of objects":
        with file.open("wb") as data:
            np.save(data, objects)
    elif kind == "objects":
        with file.open("wb") as data:
            np.savez(data, version=objects)
    else:
        with zipfile.ZipFile(file, "w") as archive:
            archive.writestr("readme.txt", "no columns")


@pytest.mark.parametrize("kind", ["text", "pickle", "array of objects", "objects", "zip"])
def test_a_file_that_is_no_table_is_refused_without_a_word_of_unpickling(
    kind: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "mine.npz"
    no_table(kind, file)
    log = str(logs(tmp_path, minutes=0.5)[0])

    assert run(["learn-progress", "--check", log, "--table", str(file)]) == EXIT_USER
    told = capsys.readouterr().err
    assert told.count("\n") == 1
    assert f"{file}: no table of progress: " in told
    assert "pickle" not in told
    assert ("learn-progress --out" in told) == (kind in ("text", "pickle", "array of objects"))


def test_the_shipped_table_says_whose_drives_it_was_learnt_from() -> None:
    words = read_trees(SHIPPED_TABLE).words
    notice = SHIPPED_TABLE.with_suffix(".LICENSE.txt").read_text(encoding="utf-8")

    assert "CC BY-SA 4.0" in words["licence"]
    for drive in words["drives"].split(", "):
        assert drive in notice
