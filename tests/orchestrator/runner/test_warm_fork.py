"""Forks of a process that has read all, in interpreters of their own: pytest runs threads."""

from __future__ import annotations

import subprocess
import sys
import textwrap

HEAD = """
import logging, os, signal, subprocess, threading, time
from foretwin.orchestrator.runner.warm_fork import forked, trouble_with_forking
"""


def run(script: str) -> list[str]:
    """Run a script in a fresh interpreter; returns the lines that it prints."""
    done = subprocess.run(
        [sys.executable, "-P", "-c", HEAD + textwrap.dedent(script)],
        capture_output=True, text=True, timeout=120, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    return done.stdout.splitlines()


def test_a_fork_has_what_was_read_and_leaves_with_its_own_code() -> None:
    said = run("""
        read = {"map": 7}
        child = forked(lambda: read["map"])
        print(child.wait(60), child.poll(), child.pid != os.getpid())
        print(forked(lambda: os.kill(os.getpid(), signal.SIGSEGV)).wait(60))
    """)
    assert said == ["7 7 True", "-11"]


def test_what_a_fork_raises_is_logged_and_its_code_is_1() -> None:
    said = run("""
        import sys
        logging.basicConfig(stream=sys.stdout, format="%(message)s")
        def fails():
            raise ValueError("torn")
        print("code", forked(fails).wait(60))
    """)
    assert said[0] == "a forked process ended by an error"
    assert said[-2:] == ["ValueError: torn", "code 1"]


def test_a_fork_is_waited_for_and_killed() -> None:
    said = run("""
        child = forked(lambda: signal.pause() or 0)
        try:
            child.wait(0.05)
        except subprocess.TimeoutExpired:
            print("still there", child.poll())
        child.kill()
        print(child.poll())
        child.send_signal(signal.SIGTERM)  # to nobody
    """)
    assert said == ["still there None", "-9"]


def test_a_screen_that_is_a_file_on_a_full_disk_keeps_nobody_from_forking() -> None:
    said = run("""
        import sys
        before, sys.stdout = sys.stdout, open("/dev/full", "w")
        print("what is not taken")
        child = forked(lambda: 7)
        os.write(before.fileno(), b"code %d\\n" % child.wait(60))
        os._exit(0)
    """)
    assert said == ["code 7"]


def test_who_was_started_without_a_screen_forks() -> None:
    said = run("""
        import sys
        before = sys.stdout
        sys.stdout = sys.stderr = None
        code = forked(lambda: 7).wait(60)
        print(code, file=before)
    """)
    assert said == ["7"]


def test_a_fork_whose_end_could_not_be_seen_is_ended() -> None:
    said = run("""
        def none_left(pid):
            raise OSError(24, "Too many open files")
        os.pidfd_open = none_left
        try:
            forked(lambda: signal.pause() or 0)
        except OSError as error:
            print(error)
        try:
            os.waitpid(-1, os.WNOHANG)
        except ChildProcessError:
            print("no child")
    """)
    assert said == ["[Errno 24] Too many open files", "no child"]


def test_a_process_with_threads_is_not_forked() -> None:
    said = run("""
        print(trouble_with_forking())
        ended = threading.Event()
        thread = threading.Thread(target=ended.wait, name="looks")
        thread.start()
        print(trouble_with_forking())
        try:
            forked(lambda: 0)
        except RuntimeError as error:
            print(error)
        ended.set()
        thread.join()
        print(trouble_with_forking())
    """)
    why = "threads run in it: looks"
    assert said == ["None", why, f"this process cannot be forked: {why}", "None"]


def test_a_process_that_is_on_the_bus_is_not_forked() -> None:
    (said,) = run("""
        from foretwin.contracts.bus import ZenohBus
        from foretwin.contracts.ports import free_endpoint
        from foretwin.contracts.setup import BusSetup
        with ZenohBus(BusSetup(endpoint=free_endpoint()), router=True):
            print(trouble_with_forking())
    """)
    assert said.startswith("threads of a library run in it: ")


def test_all_that_a_drive_imports_can_be_forked() -> None:
    assert run("""
        import foretwin.orchestrator.drive.drive
        print(trouble_with_forking())
    """) == ["None"]
