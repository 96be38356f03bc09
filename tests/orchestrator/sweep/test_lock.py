"""Two sweeps never write into one folder."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from foretwin.contracts.errors import UserError
from foretwin.orchestrator.commands.cli import run
from foretwin.orchestrator.sweep.lock import LOCK, folder_lock
from tests.orchestrator.sweeps import small_sweep

HOLDER = """
import subprocess, sys
from pathlib import Path
from foretwin.orchestrator.sweep.lock import folder_lock

with folder_lock(Path(sys.argv[1])):
    child = subprocess.Popen([sys.executable, "-c", "import sys; sys.stdin.read()"])
    print(child.pid, flush=True)
    sys.stdin.read()
"""


@contextmanager
def held_elsewhere(folder: Path) -> Iterator[subprocess.Popen[str]]:
    """Another process that holds the folder's lock, and has a child of its own."""
    with subprocess.Popen(
        [sys.executable, "-c", HOLDER, str(folder)], cwd=Path(__file__).parents[3], text=True,
        stdin=subprocess.PIPE, stdout=subprocess.PIPE,
    ) as process:  # fmt: skip
        assert process.stdout is not None
        child = int(process.stdout.readline())
        try:
            yield process
        finally:
            process.kill()
            os.kill(child, signal.SIGKILL)


def test_a_second_sweep_in_a_folder_is_refused_and_told_by_whom(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    spec, out = small_sweep(tmp_path), tmp_path / "out"
    out.mkdir()
    with held_elsewhere(out) as other:
        for more in ([], ["--fresh"]):
            assert run(["sweep", str(spec), "--out", str(out), *more]) == 2
            said = capsys.readouterr().err
            assert said.count("\n") == 1
            assert f"--out {out}: another sweep writes there, process {other.pid}" in said
        assert [path.name for path in out.iterdir()] == [LOCK]


def test_a_lock_ends_with_its_process_though_a_child_lives(tmp_path: Path) -> None:
    with held_elsewhere(tmp_path) as other:
        with pytest.raises(UserError, match=f"process {other.pid}"), folder_lock(tmp_path):
            pass
        other.kill()
        other.wait()
        with folder_lock(tmp_path):
            assert (tmp_path / LOCK).read_text() == f"{os.getpid()}\n"


def test_a_lock_is_free_again_after_an_error(tmp_path: Path) -> None:
    with pytest.raises(RuntimeError), folder_lock(tmp_path):
        raise RuntimeError
    with folder_lock(tmp_path), pytest.raises(UserError), folder_lock(tmp_path):
        pass


def test_a_folder_of_something_else_gets_no_lock(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    spec, out = small_sweep(tmp_path), tmp_path / "out"
    out.mkdir()
    (out / "letter.txt").write_text("")
    assert run(["sweep", str(spec), "--out", str(out)]) == 2
    assert "holds other files and no sweep" in capsys.readouterr().err
    assert [path.name for path in out.iterdir()] == ["letter.txt"]
