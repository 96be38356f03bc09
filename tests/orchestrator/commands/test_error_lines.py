"""What the command line refuses is one line, with the value that was given."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from foretwin.orchestrator.commands.cli import run
from foretwin.orchestrator.embedded import MAP_FILE


@pytest.mark.parametrize(
    ("arguments", "line"),
    [
        (["drive", "--workers", "abc"], "foretwin drive: --workers abc: must be a valid integer"),
        (["drive", "--rate=x"], "foretwin drive: --rate x: must be a valid number"),
        (["drive", "--lgo", "x"], "foretwin drive: No such option: --lgo; did you mean --log?"),
        (["drive", "-x"], "foretwin drive: No such option: -x"),
        (["map", "foo"], "foretwin map: No such command 'foo'"),
        (["sweep"], "foretwin sweep: Missing argument 'SPEC'"),
        (["report", "R", "--out", "a.html", "--out=b.html"],
         "foretwin report: --out: takes one value, and is given 2 times"),
        (["map", "town", "--out", "a.osm", "--out", "b.osm"],
         "foretwin map town: --out: takes one value, and is given 2 times"),
        (["doctor", "extra"], "foretwin doctor: Got unexpected extra argument(s) (extra)"),
    ],
)  # fmt: skip
def test_a_wrong_call_is_told_in_one_line(
    arguments: list[str], line: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(arguments) == 2
    command = line.split(":")[0]
    assert capsys.readouterr().err == f"{line} (see {command} --help)\n"


def test_flags_and_options_of_several_values_may_stand_twice(
    capsys: pytest.CaptureFixture[str],
) -> None:
    several = ["--scenario", "ccftap", "--scenario", "no_such"]
    assert run(["scenarios", "place", str(MAP_FILE), *several, "--json", "--json"]) == 2
    assert "no_such" in capsys.readouterr().err


def test_no_command_at_all_shows_the_help(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["map"]) == 2
    said = capsys.readouterr()
    assert (said.out + said.err).count("Usage:") == 1


def test_a_name_that_is_too_long_is_the_users(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / f"{'x' * 300}.geojson"
    assert run(["world", str(MAP_FILE), "--id", "n4", "--out", str(out)]) == 2
    error = capsys.readouterr().err
    assert error.startswith("foretwin: ")
    assert error.endswith(": file name too long\n")


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="no /dev/full here")
def test_a_full_disk_is_told_in_one_line() -> None:
    command = [sys.executable, "-m", "foretwin", "intersections", str(MAP_FILE), "--json"]
    with Path("/dev/full").open("wb") as full:
        ended = subprocess.run(command, stdout=full, stderr=subprocess.PIPE, text=True, check=False)
    assert (ended.returncode, ended.stderr) == (2, "foretwin: output: no space left on device\n")


@pytest.mark.parametrize("asked", ["--help", "--version", "scenarios", "scenarios --json"])
def test_who_has_read_enough_of_a_pipe_hears_of_no_failure(asked: str) -> None:
    reads, writes = os.pipe()
    os.close(reads)
    ended = subprocess.run(
        [sys.executable, "-m", "foretwin", *asked.split()],
        stdout=writes, stderr=subprocess.PIPE, text=True, check=False,
    )  # fmt: skip
    os.close(writes)
    assert (ended.returncode, ended.stderr) == (0, "")
