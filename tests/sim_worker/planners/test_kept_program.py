"""Programs of others: told how they ended, and gone with their children when nobody wants them."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from foretwin.sim_worker.planners.kept_program import KeptProgram
from tests.system.foretwin_command import REPOSITORY, is_running, wait_for

COVERS = ("foretwin.sim_worker.planners.stack_keeper",)


def shell(script: str, folder: Path, **told: str) -> KeptProgram:
    return KeptProgram(["sh", "-c", script], folder=str(folder), log=folder / "log", told=told)


@pytest.mark.parametrize(
    ("script", "words"),
    [
        ("exit 3", "ended by exit code 3"),
        ("echo here >&2; echo; exit 0", "ended by exit code 0 (here)"),
        ("kill -SEGV $$", "ended by signal 11"),
        ('echo "$WORD in $(pwd)"', "ended by exit code 0 (hello in {folder})"),
    ],
)
def test_how_it_ended_is_told(script: str, words: str, tmp_path: Path) -> None:
    assert shell(script, tmp_path, WORD="hello").ending() == words.format(folder=tmp_path)


def test_what_an_earlier_life_printed_is_kept_and_not_told_of_this_one(tmp_path: Path) -> None:
    shell("echo first", tmp_path).ending()
    assert shell("exit 1", tmp_path).ending() == "ended by exit code 1"
    assert (tmp_path / "log").read_text() == "first\n"


def test_what_is_not_there_is_named(tmp_path: Path) -> None:
    gone = KeptProgram(["/no/such"], folder=None, log=tmp_path / "log", told={})
    assert gone.ending() == "ended by exit code 127 (/no/such: no such file or directory)"
    with pytest.raises(FileNotFoundError):
        KeptProgram(["true"], folder=str(tmp_path / "nowhere"), log=tmp_path / "log", told={})


@pytest.mark.parametrize("stubborn", ["", "trap '' TERM; "])
def test_all_that_it_has_started_ends_with_it(stubborn: str, tmp_path: Path) -> None:
    pids = tmp_path / "pids"
    script = f"{stubborn}sleep 600 & echo $! $$ > {pids}; while true; do sleep 600; done"
    program = shell(script, tmp_path)
    wait_for(lambda: pids.exists() and len(pids.read_text().split()) == 2, "its start")
    started = [program.pid, *map(int, pids.read_text().split())]
    assert all(map(is_running, started))
    assert not program.has_ended
    program.end()
    wait_for(lambda: not any(map(is_running, started)), "the end of all of them")


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="only Linux can do that")
def test_it_ends_where_who_keeps_it_is_killed(tmp_path: Path) -> None:
    program = shell(f"echo $$ > {tmp_path / 'pid'}; exec sleep 600", tmp_path)
    wait_for(lambda: (tmp_path / "pid").exists() and (tmp_path / "pid").read_text(), "its start")
    pid = int((tmp_path / "pid").read_text())
    os.kill(program.pid, signal.SIGKILL)
    assert program.ending() == "ended by signal 9"
    wait_for(lambda: not is_running(pid), "its end")


STARTS = """
import sys, time
from pathlib import Path
from foretwin.sim_worker.planners.kept_program import KeptProgram
words = [sys.executable, "-c", "import time; print('begun', flush=True); time.sleep(600)"]
program = KeptProgram(words, folder=None, log=Path(sys.argv[1]), told={})
print(program.pid, flush=True)
time.sleep(600)
"""


def test_it_ends_where_who_started_it_is_killed(tmp_path: Path) -> None:
    log = tmp_path / "log"
    starter = subprocess.Popen(
        [sys.executable, "-c", STARTS, str(log)], stdout=subprocess.PIPE, text=True, cwd=REPOSITORY
    )
    assert starter.stdout is not None
    keeper = int(starter.stdout.readline())
    wait_for(lambda: log.read_text() == "begun\n", "its start")
    starter.kill()
    starter.wait()
    starter.stdout.close()
    wait_for(lambda: not is_running(keeper), "the end of who kept it")
