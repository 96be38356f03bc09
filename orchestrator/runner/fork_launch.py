"""Starts the processes of a drive as forks of their supervisor, which has imported what they need.

Importing is most of what a process does until it can take work, and each would do it for itself. A
fork has nothing else of its supervisor: no file, no signal handler, no module named `__main__`.
"""

from __future__ import annotations

import contextlib
import functools
import importlib
import logging
import os
import runpy
import signal
import sys
import traceback
from collections.abc import Collection
from pathlib import Path

from foretwin.contracts.end_signals import END_SIGNALS
from foretwin.contracts.process_name import name_process
from foretwin.contracts.process_setup import STARTED_BY, ProcessSetup, write_setup
from foretwin.contracts.terminal import say
from foretwin.orchestrator.runner.launch import ONE_THREAD, Child, FreshInterpreter
from foretwin.orchestrator.runner.warm_fork import forked, trouble_with_forking

log = logging.getLogger("orchestrator")

_ENDING = (signal.SIGINT, *END_SIGNALS)


class Forks:
    """Starts each process as a fork of this one, in a session of its own; see FreshInterpreter.

    Where this process cannot be forked, since threads run in it, it starts fresh interpreters.
    """

    def __init__(
        self,
        folder: Path,
        *,
        fresh: Collection[str] = (),
        imported: Collection[str] = (),
        package: str = "foretwin",
    ) -> None:
        """All modules are named below `package`.

        Those in `fresh` are not forked; `imported` is what forks find imported. It must start no
        thread as it is imported.
        """
        self._folder, self.fresh, self.imported = folder, fresh, imported
        self._package = package
        self._fresh_interpreter = FreshInterpreter(folder, package=package)

    def __call__(self, *, module: str, setup: ProcessSetup) -> Child:
        """Start a process running `module` with `setup`."""
        if module in self.fresh:
            child = self._fresh_interpreter(module=module, setup=setup)
            self._import()  # while that one starts
            return child
        self._import()
        trouble = trouble_with_forking()
        if trouble is not None:
            log.info("%s is no fork: %s", setup.process_id, trouble)
            return self._fresh_interpreter(module=module, setup=setup)
        file = self._folder / f"{setup.process_id}.json"
        write_setup(setup, file)
        stderr = os.open(file.with_suffix(".stderr"), os.O_WRONLY | os.O_CREAT | os.O_APPEND, 0o666)
        # What ends a fork waits until it has handlers of its own, not its supervisor's.
        before = signal.pthread_sigmask(signal.SIG_BLOCK, _ENDING)
        try:
            name = f"{self._package}.{module}"
            return forked(functools.partial(_be_process, name, file, stderr, os.getpid()))
        finally:
            signal.pthread_sigmask(signal.SIG_SETMASK, before)
            os.close(stderr)

    def _import(self) -> None:
        path = sys.path.copy()
        leave_out_working_directory()
        for name in self.imported:
            with contextlib.suppress(Exception):  # the process that needs it tells of it
                importlib.import_module(f"{self._package}.{name}")
        sys.path[:] = path


def _be_process(module: str, setup_file: Path, stderr: int, supervisor_pid: int) -> int:
    os.setsid()
    name_process(setup_file.stem)
    forget_signals()
    signal.pthread_sigmask(signal.SIG_UNBLOCK, _ENDING)
    keep_only(stderr)
    os.environ |= ONE_THREAD | {STARTED_BY: f"{supervisor_pid}"}
    leave_out_working_directory()
    return run_module(module, ["--setup", str(setup_file)])


def forget_signals() -> None:
    """Take signals as one that has just begun does; what is ignored, as by nohup, stays ignored."""
    for number in _ENDING:
        if signal.getsignal(number) != signal.SIG_IGN:
            anew = signal.default_int_handler if number == signal.SIGINT else signal.SIG_DFL
            signal.signal(number, anew)


def keep_only(out: int) -> None:
    """Let the file `out` be where all is said, and hold no other file: locks are the parent's.

    Numbers stay taken: who closes a file of the parent's must close none of the child's.
    """
    nothing = os.open(os.devnull, os.O_RDWR)
    os.dup2(out, 1)
    os.dup2(out, 2)
    for file in list(Path("/proc/self/fd").iterdir()):
        with contextlib.suppress(OSError):
            # What lies in /proc the child has opened itself, as it was forked.
            if int(file.name) not in (1, 2) and not str(file.readlink()).startswith("/proc/"):
                os.dup2(nothing, int(file.name))
    sys.stdout, sys.stderr = sys.__stdout__, sys.__stderr__


def leave_out_working_directory() -> None:
    """Import nothing from where the command was started or lies, as an interpreter with `-P`."""
    if not sys.flags.safe_path and sys.path:
        begun_in = ("", str(Path.cwd()), str(Path(sys.argv[0]).resolve().parent))
        if sys.path[0] in begun_in:
            del sys.path[0]


def run_module(module: str, words: list[str]) -> int:
    """Run a module as `python -m` does, although it is imported; returns the exit code."""
    sys.argv = [module, *words]
    for begun_anew in (f"{module}.__main__", module):
        if not hasattr(sys.modules.get(begun_anew), "__path__"):
            sys.modules.pop(begun_anew, None)
    try:
        runpy.run_module(module, run_name="__main__", alter_sys=True)
    except SystemExit as left:
        if isinstance(left.code, str):
            say(left.code, error=True)
        return left.code if isinstance(left.code, int) else int(left.code is not None)
    except BaseException:
        traceback.print_exc()
        return 1
    return 0
