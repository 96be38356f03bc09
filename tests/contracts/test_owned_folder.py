"""Folders for a while: those of a killed process go with the next one, those of others never."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import tempfile
from pathlib import Path

import pytest

from foretwin.contracts import owned_folder
from foretwin.contracts.owned_folder import (
    LOCK,
    make_temporary,
    own,
    remove_left,
    temporary_folder,
)
from tests.system.foretwin_command import wait_for

PREFIX = "foretwin-test-"
OWNS = f"""
import os, sys, time
from foretwin.contracts.owned_folder import make_temporary
owned = make_temporary({PREFIX!r})
(owned.path / "file").write_text("of it")
if sys.argv[1:]:
    owned.keep_over_exec()
    print(owned.path, flush=True)
    os.execv(sys.executable, [sys.executable, "-c", "import time; time.sleep(600)"])
print(owned.path, flush=True)
if not os.fork():
    os.close(1)
    time.sleep(600)
print(os.getpid(), flush=True)
time.sleep(600)
"""


@pytest.fixture(autouse=True)
def _temporary(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))


def started(tmp_path: Path, *arguments: str) -> tuple[subprocess.Popen[str], Path]:
    process = subprocess.Popen(
        [sys.executable, "-c", OWNS, *arguments], env=os.environ | {"TMPDIR": str(tmp_path)},
        stdout=subprocess.PIPE, text=True, start_new_session=True,
    )  # fmt: skip
    assert process.stdout is not None
    return process, Path(process.stdout.readline().strip())


def kill(process: subprocess.Popen[str]) -> None:
    os.killpg(process.pid, signal.SIGKILL)
    process.wait()
    assert process.stdout is not None
    process.stdout.close()


def test_a_folder_is_there_for_a_while_and_gone_afterwards() -> None:
    with temporary_folder(PREFIX) as folder:
        (folder / "file").write_text("text")
        assert folder.stat().st_mode & 0o077 == 0
        with temporary_folder(PREFIX) as other:
            assert other != folder
        assert folder.is_dir()
    assert not folder.exists()


def test_what_a_killed_process_left_goes_with_the_next_one(tmp_path: Path) -> None:
    process, folder = started(tmp_path)
    with temporary_folder(PREFIX):
        assert (folder / "file").exists()
    assert process.stdout is not None
    process.stdout.readline()
    os.kill(process.pid, signal.SIGKILL)  # its fork lives on, and owns the folder
    with temporary_folder(PREFIX):
        assert (folder / "file").exists()
    kill(process)

    def next_one() -> bool:
        with temporary_folder(PREFIX):
            return not folder.exists()

    wait_for(next_one, "the end of the fork")


def test_a_program_that_its_maker_becomes_owns_it(tmp_path: Path) -> None:
    process, folder = started(tmp_path, "exec")
    assert remove_left(tmp_path, PREFIX) == []
    kill(process)
    assert remove_left(tmp_path, PREFIX) == [folder]
    assert not folder.exists()


def test_what_nobody_says_it_owned_is_left_alone(tmp_path: Path) -> None:
    """Never by guess: another prefix, no lock in it, a link to elsewhere, a file."""
    elsewhere = tmp_path / "elsewhere"
    for folder in (elsewhere, tmp_path / f"{PREFIX}without-lock", tmp_path / "another-prefix"):
        folder.mkdir()
    (elsewhere / LOCK).write_text("")
    (tmp_path / "another-prefix" / LOCK).write_text("")
    (tmp_path / f"{PREFIX}link").symlink_to(elsewhere)
    (tmp_path / f"{PREFIX}file").write_text("")
    assert remove_left(tmp_path, PREFIX) == []
    assert remove_left(tmp_path / "nothing", PREFIX) == []
    assert len(list(tmp_path.iterdir())) == 5
    assert (elsewhere / LOCK).exists()


def test_who_comes_second_does_not_own_it(tmp_path: Path) -> None:
    folder = tmp_path / "folder"
    folder.mkdir()
    first = own(folder)
    assert first is not None
    assert own(folder) is None
    first.remove()
    first.remove()
    assert own(folder) is None  # it is gone
    assert not owned_folder._remove_left(folder)


def test_a_folder_that_is_removed_twice_is_kept_over_nothing(tmp_path: Path) -> None:
    open_before = len(list(Path("/proc/self/fd").iterdir()))
    folder = own(tmp_path)
    assert folder is not None
    folder.remove()
    folder.keep_over_exec()
    assert len(list(Path("/proc/self/fd").iterdir())) == open_before


def test_a_folder_that_another_removes_as_it_is_made_is_made_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    made: list[Path] = []

    def snatched(folder: Path) -> owned_folder.OwnedFolder | None:
        made.append(folder)
        if len(made) == 1:
            folder.rmdir()
        return own(folder)

    monkeypatch.setattr(owned_folder, "own", snatched)
    owned = make_temporary(PREFIX)
    assert [folder.exists() for folder in made] == [False, True]
    owned.remove()
