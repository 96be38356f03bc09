"""Processes as forks of their supervisor, which is an interpreter without pytest's threads."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import textwrap
from pathlib import Path
from typing import Any

import pytest

HEAD = """
import fcntl, json, logging, os, signal, sys, threading
from pathlib import Path
from types import SimpleNamespace
from foretwin.contracts.setup import BusSetup, ProcessSetup
from foretwin.orchestrator.runner.fork_launch import Forks

folder = Path(sys.argv[1])

def setup(name="w0"):
    return ProcessSetup(run_id="r", process_id=name, vehicle_id="ego",
                        bus=BusSetup(endpoint="tcp/127.0.0.1:1"), log_file=os.devnull)

def start(module, name="w0", **options):
    return Forks(folder, package="package", **options)(module=module, setup=setup(name))
"""
TELLS = """
import json, os, signal, sys
from pathlib import Path
from foretwin.contracts.process_setup import parent_pid
from package import read
told = {
    "name": __name__, "words": sys.argv[1:], "parent": parent_pid(), "left": parent_pid(),
    "session": os.getsid(0) == os.getpid(), "read_by": read.PID, "path": sys.path,
    "called": Path("/proc/self/comm").read_text().strip(),
    "threads": os.environ["OPENBLAS_NUM_THREADS"],
    "term": signal.getsignal(signal.SIGTERM) == signal.SIG_DFL,
    "files": sorted(os.readlink(f"/proc/self/fd/{n}") for n in os.listdir("/proc/self/fd")
                    if os.path.exists(f"/proc/self/fd/{n}")),
}
print(json.dumps(told))
"""


@pytest.fixture
def package(tmp_path: Path) -> Path:
    """A folder with modules to run, and where their processes find setups and leave words."""
    folder = tmp_path / "package"
    folder.mkdir()
    for name, text in {
        "__init__": "", "tells": TELLS, "read": "import os\nPID = os.getpid()\n",
        "breaks": "raise KeyError('torn')\n", "leaves": "raise SystemExit('wrong setup')\n",
        "stays": "import time\nprint('up', flush=True)\ntime.sleep(60)\n",
    }.items():  # fmt: skip
        (folder / f"{name}.py").write_text(text)
    return tmp_path


def run(script: str, package: Path, *words: str) -> list[str]:
    """Run a script beside a package; returns the lines that it prints."""
    done = subprocess.run(
        [sys.executable, *words, "-c", HEAD + textwrap.dedent(script), str(package)],
        capture_output=True, text=True, timeout=120, check=False, cwd=package,
        env=os.environ | {"PYTHONPATH": os.pathsep.join([str(package), *sys.path])},
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    return done.stdout.splitlines()


def told(package: Path, name: str = "w0") -> dict[str, Any]:
    return json.loads((package / f"{name}.stderr").read_text())


def test_a_fork_is_a_process_of_its_own_that_finds_read_what_its_supervisor_read(
    package: Path,
) -> None:
    (pid,) = run("""
        signal.signal(signal.SIGTERM, lambda *_: None)
        held = open(folder / "run.lock", "w")
        fcntl.flock(held, fcntl.LOCK_EX)
        child = start("tells", imported=["read"])
        assert child.wait(60) == 0
        print(os.getpid())
    """, package)  # fmt: skip
    said = told(package)
    assert said["name"] == "__main__"
    assert said["words"] == ["--setup", str(package / "w0.json")]
    assert (said["parent"], said["left"], said["read_by"]) == (int(pid),) * 3
    assert said["session"]
    assert said["term"]
    assert (said["called"], said["threads"]) == ("ft-w0", "1")
    assert not [name for name in said["files"] if name.endswith("run.lock")]


def test_a_lock_of_the_supervisor_is_not_held_by_who_outlives_it(package: Path) -> None:
    lines = run("""
        held = open(folder / "run.lock", "w")
        fcntl.flock(held, fcntl.LOCK_EX)
        child = start("stays")
        while "up" not in (folder / "w0.stderr").read_text():
            pass
        held.close()
        with open(folder / "run.lock", "w") as again:
            fcntl.flock(again, fcntl.LOCK_EX | fcntl.LOCK_NB)
        child.kill()
        print("free")
    """, package)  # fmt: skip
    assert lines == ["free"]


def test_what_is_named_fresh_is_no_fork_and_others_are_read_for_while_it_starts(
    package: Path,
) -> None:
    pid, read = run("""
        child = start("tells", imported=["read"], fresh=["tells"])
        assert child.wait(60) == 0
        print(os.getpid(), "package.read" in sys.modules, sep="\\n")
    """, package)  # fmt: skip
    assert told(package)["read_by"] != int(pid)
    assert read == "True"


def test_who_has_threads_starts_fresh_interpreters(package: Path) -> None:
    pid, *log = run("""
        logging.basicConfig(stream=sys.stdout, format="%(message)s", level=logging.INFO)
        ended = threading.Event()
        thread = threading.Thread(target=ended.wait, name="of the bus")
        thread.start()
        print(os.getpid(), flush=True)
        assert start("tells", imported=["read"]).wait(60) == 0
        ended.set()
    """, package)  # fmt: skip
    assert told(package)["read_by"] != int(pid)
    assert log == ["w0 is no fork: threads run in it: of the bus"]


def test_a_crash_leaves_its_traceback_and_a_refusal_its_line(package: Path) -> None:
    codes = run("""
        print(start("breaks").wait(60), start("leaves", "w1").wait(60))
        print(start("no_such_module", "w2").wait(60))
    """, package)  # fmt: skip
    assert codes == ["1 1", "1"]
    assert (package / "w0.stderr").read_text().endswith("KeyError: 'torn'\n")
    assert (package / "w1.stderr").read_text() == "wrong setup\n"
    assert "No module named package.no_such_module" in (package / "w2.stderr").read_text()


def test_what_cannot_be_imported_for_all_is_told_by_who_needs_it(package: Path) -> None:
    codes = run("""
        print(start("tells", imported=["breaks", "read"]).wait(60))
        print(start("breaks", "w1", imported=["breaks"]).wait(60))
    """, package)  # fmt: skip
    assert codes == ["0", "1"]


@pytest.mark.parametrize("words", [(), ("-P",)])
def test_what_lies_where_the_command_was_started_is_not_imported(
    package: Path, words: tuple[str, ...]
) -> None:
    run('assert start("tells").wait(60) == 0', package, *words)
    assert "" not in told(package)["path"]
    assert str(package) in told(package)["path"]  # by its own entry


def test_a_process_that_is_started_again_adds_to_what_was_said(package: Path) -> None:
    run("""
        for _ in range(2):
            start("leaves").wait(60)
    """, package)  # fmt: skip
    assert (package / "w0.stderr").read_text() == "wrong setup\n" * 2


def test_one_that_is_told_to_end_as_it_is_forked_ends(package: Path) -> None:
    codes = run("""
        for number in (signal.SIGTERM, signal.SIGHUP):
            signal.signal(number, lambda *_: None)
        for number in (signal.SIGTERM, signal.SIGHUP) * 5:
            child = start("stays")
            child.send_signal(number)
            print(child.wait(60))
    """, package)  # fmt: skip
    assert codes == ["-15", "-1"] * 5


def test_what_is_ignored_as_by_nohup_stays_ignored(package: Path) -> None:
    codes = run("""
        signal.signal(signal.SIGHUP, signal.SIG_IGN)
        child = start("stays")
        child.send_signal(signal.SIGHUP)
        child.send_signal(signal.SIGTERM)
        print(child.wait(60))
    """, package)  # fmt: skip
    assert codes == ["-15"]


def test_an_import_that_starts_a_thread_makes_all_fresh(package: Path) -> None:
    (package / "package" / "threads.py").write_text(
        "import threading\n"
        "threading.Thread(target=threading.Event().wait, daemon=True, name='lib').start()\n"
    )
    (pid,) = run("""
        print(os.getpid())
        assert start("tells", imported=["read", "threads"]).wait(60) == 0
    """, package)  # fmt: skip
    assert told(package)["read_by"] != int(pid)
