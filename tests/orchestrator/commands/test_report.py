"""`foretwin report`: the file that it writes, and mistakes in one line."""

from __future__ import annotations

import json
import re
import shutil
from pathlib import Path

import pytest

from foretwin.contracts.errors import UserError
from foretwin.contracts.segments import DRIVE_FILE, segment_file
from foretwin.orchestrator.commands import compare, progress_bar
from foretwin.orchestrator.commands.cli import run
from foretwin.orchestrator.commands.output import size_words
from tests.orchestrator.across.test_changes import case, sweep_of
from tests.orchestrator.report.told_runs import NAME, told_run


def test_it_writes_the_file_and_says_the_verdict(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "new" / "report.html"

    assert run(["report", str(told_run(tmp_path)), "--out", str(out), "--redact", "places"]) == 0

    said = capsys.readouterr().out
    assert said.startswith("The car passed 1 junction")
    assert f"wrote {out} ({out.stat().st_size / 1e6:.1f} MB)" in said
    assert out.read_text(encoding="utf-8").startswith("<!DOCTYPE html>")


def test_a_size_below_a_megabyte_is_no_zero() -> None:
    assert [size_words(size) for size in (41_234, 999_400, 1_000_000)] == [
        "41 kB", "999 kB", "1.0 MB",
    ]  # fmt: skip


def test_json_holds_the_indicators_over_several_runs_and_nothing_else_is_printed(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    runs = [
        str(told_run(tmp_path / name, run_id=f"20261123-12000{name}-told")) for name in ("0", "1")
    ]
    out = tmp_path / "two.html"

    assert run(["report", *runs, "--out", str(out), "--json"]) == 0

    told = json.loads(capsys.readouterr().out)
    assert (told["file"], told["size_bytes"]) == (str(out), out.stat().st_size)
    assert told["verdict"].startswith("What B foresaw")
    assert told["indicators"]["drives"] == 2
    lost = [one for one in told["indicators"]["indicators"] if one["name"] == "telemetry lost"]
    assert [(one["events"], one["exposure"], one["low"]) for one in lost] == [(0, 80.0, 0.0)]


def test_what_could_not_be_read_is_said_last_and_by_the_exit_code(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = told_run(tmp_path, futures={"count": 9})
    (folder / "results" / "futures.parquet").unlink()

    assert run(["report", str(folder), "--out", str(tmp_path / "one.html")]) == 3
    assert capsys.readouterr().out.endswith("left out: the table of futures is missing\n")


@pytest.mark.parametrize(("complete", "code"), [(True, 0), (False, 3)])
def test_a_sweep_whose_jobs_were_not_all_played_is_a_part(
    complete: bool, code: int, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    swept = sweep_of(tmp_path / "swept", [case(0)], complete=complete)

    assert run(["report", str(swept), "--out", str(tmp_path / "swept.html")]) == code
    left_out = "left out: jobs that were not played\n"
    assert capsys.readouterr().out.endswith(left_out) == (not complete)


@pytest.mark.parametrize("of", ["a run", "two runs", "a sweep"])
def test_how_far_it_is_is_counted_section_by_section_to_the_last(
    of: str,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(progress_bar, "PLAIN_PERIOD_S", 0.0)
    if of == "a sweep":
        grave = {"criticality": 1e-5, "likelihood": 0.1, "world_id": "gone", "progress_m": 9.0}
        rows = [case(number, **(grave if number < 2 else {})) for number in range(9)]
        folders = [sweep_of(tmp_path / "swept", rows)]
    else:
        names = ["0", "1"][: 1 + (of == "two runs")]
        folders = [told_run(tmp_path / name, run_id=f"20261123-12000{name}-t") for name in names]

    assert run(["report", *map(str, folders), "--out", str(tmp_path / "report.html")]) == 0

    told = re.findall(r"(\d+) of (\d+) sections, (.+)", capsys.readouterr().err)
    done = [int(count) for count, _, _ in told]
    assert done[-1] == int(told[-1][1]) >= 5
    assert done == sorted(done)
    assert len(told) >= 5
    named = {name for _, _, name in told}
    last = {"a run": f"1 · {NAME}", "two runs": "indicators", "a sweep": "Provenance"}
    assert last[of] in named


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (("--out", "report.pdf"), "a report is an HTML file, such as report.html"),
        (("--out", "report.html", "--redact", "all"), "--redact all: coarse or places"),
        (("--out", "run/run.json/report.html"), "is no folder"),
        (("--out", "report.html", "--against", "nothing.csv"), "nothing.csv: no such file"),
    ],
)
def test_mistakes_are_told_in_one_line_and_leave_nothing(
    arguments: tuple[str, ...],
    told: str,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.chdir(tmp_path)
    folder = told_run(tmp_path)

    assert run(["report", str(folder), *arguments]) == 2

    said = capsys.readouterr().err
    assert told in said
    assert said.count("\n") == 1
    assert not list(tmp_path.glob("report*"))


def test_the_recording_of_the_run_itself_is_no_other_drive(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder, out = told_run(tmp_path), tmp_path / "report.html"
    copy = shutil.copy(folder / DRIVE_FILE, tmp_path / "copy.mcap")

    assert run(["report", str(folder), "--out", str(out), "--against", str(copy)]) == 0

    assert "are recordings of one drive" in capsys.readouterr().err
    assert "How far people differ on this road is not known here" in out.read_text()


def test_people_are_compared_with_what_is_left_of_the_recording(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    def compared(first: Path, second: Path) -> None:
        raise UserError(f"{first.name} and {second.name}")

    monkeypatch.setattr(compare, "compare_logs", compared)
    folder = told_run(tmp_path)
    for part in folder.glob("drive*.mcap"):
        part.unlink()
    segment_file(folder / DRIVE_FILE, 2).write_bytes(b"as --keep leaves it")
    assert run(["report", str(folder), "--out", "report.html", "--against", "other.mcap"]) == 2
    assert "drive-002.mcap and other.mcap" in capsys.readouterr().err
