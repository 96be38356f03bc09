"""How every process of a run lives: reads its setup, joins the bus, says it is alive, and leaves.

A process leaves when the run ends (`run_end`), when it is told to (SIGTERM, SIGHUP), or when the
orchestrator is gone: at once where that has started it, after a grace where the link may come back.
Ctrl-C is the orchestrator's business: children ignore SIGINT.
"""

from __future__ import annotations

import contextlib
import fcntl
import logging
import os
import signal
import sys
import threading
import time
from collections.abc import Callable
from contextlib import closing
from pathlib import Path
from typing import TypeVar

from foretwin.contracts import trace
from foretwin.contracts.bus import Alive, Bus, Mailbox, Received, ZenohBus
from foretwin.contracts.cpu_use import CpuMeter
from foretwin.contracts.end_signals import on_end_signals
from foretwin.contracts.errors import UserError
from foretwin.contracts.guard import Refused
from foretwin.contracts.keys import alive_key
from foretwin.contracts.log_file import JsonLines, LogFile
from foretwin.contracts.one_heap import FreeMemory, share_one_heap
from foretwin.contracts.process_name import name_process
from foretwin.contracts.process_setup import BusSetup, parent_pid, setup_given
from foretwin.contracts.refusal_counts import OwnRefusals, RefusalFile
from foretwin.contracts.refusals import Refusals
from foretwin.contracts.setup import ProcessSetup
from foretwin.contracts.terminal import say

_Setup = TypeVar("_Setup", bound=ProcessSetup)


def log_to_file(setup: ProcessSetup) -> None:
    """Send the process's log to the run's file."""
    logging.raiseExceptions = False
    handler = LogFile(Path(setup.log_file))
    handler.setFormatter(JsonLines(setup.process_id))
    logging.basicConfig(level=logging.INFO, handlers=[handler], force=True)


class ProcessLife:
    """Tells a process when its run begins and when it is over; both are cheap to ask."""

    def __init__(
        self,
        setup: ProcessSetup,
        bus: Bus,
        *,
        mono_s: Callable[[], float] = time.monotonic,
        meter: CpuMeter | None = None,
        refusal_file: RefusalFile | None = None,
    ) -> None:
        self._setup = setup
        self._meter, self._refusal_file = meter, refusal_file
        self._bus = bus
        self._mono_s = mono_s
        self._free_memory = FreeMemory(mono_s())
        self._parent = parent_pid()
        self._mailbox = Mailbox(16)
        self.refusals = Refusals()
        """What of what came to this process it cannot use, for the run's record."""
        self._orchestrator_seen = False
        self._gone_since_s: float | None = None
        self.run_ended = False
        """Whether the orchestrator has said that the run is over, and waits for files."""
        self.terminated = threading.Event()
        bus.subscribe("run_end", self._mailbox, run=setup.run_id)
        bus.watch_alive(alive_key(run=setup.run_id, process="orchestrator"), self._mailbox)

    def ready(self) -> None:
        """Declare the process alive: it can take work from now on."""
        if self._meter is not None:
            self._meter.ready()
        self._bus.declare_alive(alive_key(run=self._setup.run_id, process=self._setup.process_id))

    @property
    def begun(self) -> bool:
        """Whether the orchestrator has been there."""
        self._look()
        return self._orchestrator_seen

    @property
    def over(self) -> bool:
        """Whether the process should finish what it holds and leave."""
        self._look()
        since_s = self._gone_since_s
        if since_s is not None and self._mono_s() - since_s > self._setup.grace_s:
            self.terminated.set()
        if os.getppid() != self._parent:
            self.terminated.set()
        return self.terminated.is_set()

    def _look(self) -> None:
        if self._meter is not None:
            self._meter.look()
        if self._refusal_file is not None:
            self._refusal_file.look(self.refusals)
        self._free_memory.look(self._mono_s())
        while (item := self._mailbox.take()) is not None:
            if isinstance(item, Received):
                self._take_end(item)
            elif isinstance(item, Alive) and item.up:
                self._orchestrator_seen = True
                self._gone_since_s = None
            elif isinstance(item, Alive) and self._orchestrator_seen:
                self._gone_since_s = self._mono_s()

    def _take_end(self, item: Received) -> None:
        try:
            item.message()
        except Refused as refused:
            if text := self.refusals.take(refused):
                logging.getLogger(self._setup.process_id).warning("%s", text)
            return
        self.run_ended = True
        self.terminated.set()


def hold(setup_file: Path) -> int:
    """Lock the file that a process was started with for as long as the process lives; returns the
    descriptor that holds it.

    So that whoever finds a run without its orchestrator sees who of it still writes; see `is_held`.
    """
    descriptor = os.open(setup_file, os.O_RDONLY)
    with contextlib.suppress(OSError):  # not every file system can
        fcntl.flock(descriptor, fcntl.LOCK_SH)
    return descriptor


def is_held(setup_file: Path) -> bool:
    """Whether the process that was started with a file still lives."""
    descriptor = os.open(setup_file, os.O_RDONLY)
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return True
    except OSError:
        return False
    finally:
        os.close(descriptor)
    return False


def run_process(
    kind: type[_Setup],
    serve: Callable[[_Setup, Bus, ProcessLife], None],
    argv: list[str] | None = None,
    *,
    join: Callable[[BusSetup], Bus] = ZenohBus,
) -> None:
    """Run `serve` as this process's work, with `--setup FILE` from the command line; it is on the
    bus as `join` says.

    Leaves through os._exit: a library's exit handler must not hold up the end of a drive. Exit
    codes: 0 done, 2 something wrong with setup or input, in one line, 1 any other error.
    """
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    share_one_heap()
    file, setup = setup_given(kind, argv)
    name_process(setup.process_id)
    hold(file)
    log_to_file(setup)
    if setup.trace_dir is not None:
        trace.begin(Path(setup.trace_dir), setup.process_id)
    meter, code = CpuMeter(file.parent, setup.process_id), 0
    refusal_file = RefusalFile(file.parent, setup.process_id)
    try:
        with closing(join(setup.bus)) as bus:
            life = ProcessLife(setup, bus, meter=meter, refusal_file=refusal_file)
            on_end_signals(life.terminated.set)
            serve(setup, bus, life)
            refusal_file.write(OwnRefusals(kinds=life.refusals.kinds()))
    except (UserError, OSError) as problem:
        logging.getLogger(setup.process_id).exception("%s", problem)
        say(f"{setup.process_id}: {problem}", error=True)
        code = 2
    except Exception:
        logging.getLogger(setup.process_id).exception("ended by an error")
        code = 1
    trace.end()
    meter.write()
    logging.shutdown()
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(code)
