"""The supervisor and its forks, beside pytest's threads: what one dies of the next is told."""

from __future__ import annotations

import json
import subprocess
import sys
import textwrap
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

COVERS = ("foretwin.orchestrator.drive.interrupt",)
Run = Callable[..., list[str]]

HEAD = """
import logging, os, signal, sys, time
from pathlib import Path
from types import SimpleNamespace
from foretwin.contracts.errors import UserError
from foretwin.orchestrator.drive import foreground, supervisor_link
from foretwin.orchestrator.drive.supervision import CRASHED, DriveError
from foretwin.orchestrator.runner.launch import FreshInterpreter
from foretwin.orchestrator.runner.supervisor import Supervisor

foreground.start_all = lambda supervisor, plan: None
foreground.forget_results = lambda plan: print("forgets", flush=True)
supervisor_link.rows_by_id = lambda plan: {}
Supervisor.pause_s = lambda self, name, now_s, left=[0.0, 0.0, 0.0]: left.pop() if left else None
folder = Path(sys.argv[1])
config = SimpleNamespace(lock_step=False)
plan = SimpleNamespace(folder=folder, processes_dir=folder / "processes", config=config)

logging.disable()

def die(number=signal.SIGKILL):
    os.kill(os.getpid(), number)

def supervise(orchestrate):
    return foreground.Foreground(plan, orchestrate, launch=FreshInterpreter(folder)).run()
"""


SCRIPTS = """
import json, os, sys, traceback
from foretwin.orchestrator.drive import foreground

def play(script, folder, screen):
    for stream, name in enumerate(("stdout", "stderr"), start=1):
        os.dup2(os.open(f"{screen}/{name}", os.O_WRONLY | os.O_CREAT), stream)
    sys.argv[1:] = [folder]
    try:
        exec(script, {"__name__": "__main__"})
        return 0
    except BaseException:
        traceback.print_exc()
        return 1
    finally:
        sys.stdout.flush()

for line in sys.stdin:
    if child := os.fork():
        print(os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]), flush=True)
    else:
        os._exit(play(*json.loads(line)))
"""
"""Plays scripts in forks of one interpreter that has imported all, which takes most of the time."""


@pytest.fixture(scope="module")
def scripts() -> Iterator[subprocess.Popen[str]]:
    with subprocess.Popen(
        [sys.executable, "-P", "-c", SCRIPTS], text=True, stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
    ) as process:  # fmt: skip
        yield process


@pytest.fixture
def run(scripts: subprocess.Popen[str], tmp_path: Path) -> Run:
    def played(script: str, folder: Path = tmp_path) -> list[str]:
        """Play a script; returns the lines that it and its forks print."""
        assert scripts.stdin is not None
        assert scripts.stdout is not None
        asked = [HEAD + textwrap.dedent(script), str(folder), str(tmp_path)]
        print(json.dumps(asked), file=scripts.stdin, flush=True)
        code = scripts.stdout.readline()
        out, err = ((tmp_path / name).read_text() for name in ("stdout", "stderr"))
        assert code == "0\n", err
        return [*out.splitlines(), *err.splitlines()]

    return played


def test_the_next_one_goes_on_with_what_the_last_one_left(run: Run) -> None:
    assert run("""
        def orchestrate(plan, link, life):
            print(life.standing, life.ended_by, life.last, flush=True)
            link.keep(f"left by {len(life.ended_by)}".encode())
            match len(life.ended_by):
                case 0:
                    die()
                case 1:
                    return CRASHED
            return 3
        print(supervise(orchestrate))
    """) == [
        "b'' () False",
        "b'left by 0' ('signal 9 (SIGKILL)',) False",
        "b'left by 1' ('signal 9 (SIGKILL)', 'an error of its own') False",
        "3",
    ]  # fmt: skip


def test_one_that_dies_again_and_again_brings_the_drive_to_its_end(run: Run) -> None:
    assert run("""
        def orchestrate(plan, link, life):
            link.keep(b"far")
            if not life.last:
                die(signal.SIGSEGV)
            print(len(life.ended_by), life.standing)
            return 1
        print(supervise(orchestrate))
    """) == ["4 b'far'", "1"]  # fmt: skip


def test_where_even_the_last_one_dies_it_is_said_what_to_do(run: Run, tmp_path: Path) -> None:
    code, said = run("""
        def orchestrate(plan, link, life):
            link.keep(b"far")
            die()
        print(supervise(orchestrate))
    """)
    assert code == "1"
    assert said == (
        "error: the orchestrator ended by signal 9 (SIGKILL), the last of 5 times; "
        f"`foretwin recover {tmp_path}` makes readable what there is"
    )


def test_a_machine_without_memory_for_a_moment_ends_no_drive(run: Run) -> None:
    assert run("""
        foreground.FORK_AGAIN_S = 0.01
        really, hears = foreground.forked, foreground.OrchestratorLink.hear
        no_fork, no_word = [MemoryError(), OSError(12, "no memory")], [MemoryError()] * 3
        def forked(work):
            if no_fork:
                raise no_fork.pop()
            return really(work)
        def hear(self):
            if no_word:
                raise no_word.pop()
            return hears(self)
        foreground.forked, foreground.OrchestratorLink.hear = forked, hear
        def orchestrate(plan, link, life):
            if life.ended_by:
                print(life.standing)
                return 3
            link.keep(b"far")
            time.sleep(0.5)
            die()
        print(supervise(orchestrate), no_fork, no_word)
    """) == ["b'far'", "3 [] []"]  # fmt: skip


def test_where_there_is_no_memory_for_long_the_drive_ends_with_that(run: Run) -> None:
    assert run("""
        foreground.FORK_AGAIN_S, foreground.WITHOUT_MEMORY_S = 0.01, 0.05
        def forked(work):
            raise OSError(12, "no memory")
        foreground.forked = forked
        try:
            supervise(lambda plan, link, life: 0)
        except OSError as error:
            print(error)
    """) == ["[Errno 12] no memory"]  # fmt: skip


def test_in_lock_step_all_is_played_again(run: Run) -> None:
    assert run("""
        config.lock_step = True
        def orchestrate(plan, link, life):
            if not life.ended_by:
                die()
            print(life.standing)
            return 0
        print(supervise(orchestrate))
    """) == ["forgets", "b''", "0"]  # fmt: skip


@pytest.mark.parametrize("number", ["SIGINT", "SIGTERM", "SIGHUP"])
def test_what_ends_a_drive_reaches_the_orchestrator(run: Run, number: str) -> None:
    assert run(f"""
        def orchestrate(plan, link, life):
            os.kill(os.getppid(), signal.{number})
            while not link.over:
                link.poll(0.0)
                time.sleep(0.01)
            return 130
        print(supervise(orchestrate))
    """) == ["130"]  # fmt: skip


@pytest.mark.parametrize("number", ["SIGINT", "SIGTERM", "SIGHUP"])
def test_what_comes_before_an_orchestrator_takes_signals_is_not_lost(run: Run, number: str) -> None:
    assert run(f"""
        from foretwin.orchestrator.drive.interrupt import Interruption
        def orchestrate(plan, link, life):
            die(signal.{number})
            own = Interruption()
            print(own.asked, link.over)
            return 130
        print(supervise(orchestrate))
    """) == ["False True", "130"]  # fmt: skip


def test_who_is_alone_is_told_and_ends(run: Run, tmp_path: Path) -> None:
    run("""
        def orchestrate(plan, link, life):
            os.kill(os.getppid(), signal.SIGKILL)
            while not link.over:
                link.poll(0.0)
                time.sleep(0.01)
            (folder / "alone").write_text(str(link.alone))
            return 0
        if os.fork():
            while not (folder / "alone").exists() or not (folder / "alone").read_text():
                time.sleep(0.01)
        else:
            supervise(orchestrate)
    """)
    assert (tmp_path / "alone").read_text() == "True"


def test_errors_of_the_user_and_of_ours_are_told_apart(run: Run, tmp_path: Path) -> None:
    (tmp_path / "run").mkdir()
    assert run("""
        def refuses(by_user):
            def orchestrate(plan, link, life):
                link.refuse("no such port", by_user=by_user)
                return 1
            return orchestrate
        for by_user in (False, True):
            try:
                supervise(refuses(by_user))
            except (DriveError, UserError) as error:
                print(type(error).__name__, error, folder.exists())
    """, tmp_path / "run") == [
        "DriveError no such port True",
        "UserError no such port False",
    ]  # fmt: skip
