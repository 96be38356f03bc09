"""The router of a run's bus: `python -m foretwin.contracts.router --setup FILE`.

It passes on what the others say and decodes none of it: no message can end it, and an orchestrator
that stands still or dies takes nobody's bus along. It ends when it is told to, or with the process
that started it. What it turns away it counts, by its own log, in a file beside its setup.
"""

from __future__ import annotations

import contextlib
import os
import shutil
import signal
import sys
import threading
from pathlib import Path

import zenoh

from foretwin.contracts.cpu_use import CpuMeter
from foretwin.contracts.end_signals import on_end_signals
from foretwin.contracts.own_log import OwnLog
from foretwin.contracts.partial_file import partial_file
from foretwin.contracts.process_name import name_process
from foretwin.contracts.process_setup import RouterSetup, parent_pid, setup_given
from foretwin.contracts.refusal_counts import RefusalFile
from foretwin.contracts.router_log import FILTER, RouterLog
from foretwin.contracts.terminal import say
from foretwin.contracts.zenoh_config import zenoh_config

LISTENS = "listens"
"""The router's word once clients can connect; any other tells why they never will."""
_LOOK_S = 0.5


def run_router(argv: list[str] | None = None) -> None:
    """Be the router until told to end. Exit codes: 0 done, 2 it cannot listen, in one line."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    os.umask(0o077)  # a socket is then its user's alone
    parent = parent_pid()
    ended = threading.Event()
    on_end_signals(ended.set)
    file, setup = setup_given(RouterSetup, argv)
    name_process(setup.process_id)
    log = RouterLog()
    own_log = OwnLog(log.take, log.gap)
    os.environ |= {"RUST_LOG": FILTER, "NO_COLOR": "1"}
    zenoh.init_log_from_env_or(FILTER)
    word_file, meter = Path(setup.word_file), CpuMeter(file.parent, file.stem)
    refusals = RefusalFile(file.parent, file.stem)
    try:
        session = zenoh.open(zenoh_config(setup.bus, router=True))
    except zenoh.ZError as error:
        _say(word_file, " ".join(str(error).split()))
        say(f"router: {error}", error=True)
        sys.exit(2)
    with session:
        _say(word_file, LISTENS)
        meter.ready()
        while not ended.wait(_LOOK_S) and os.getppid() == parent:
            meter.look()
            _tell(log, refusals)
    own_log.close()
    _tell(log, refusals)
    meter.write()
    if os.getppid() != parent and setup.folder is not None:
        shutil.rmtree(setup.folder, ignore_errors=True)
    sys.stderr.flush()
    os._exit(0)


def _tell(log: RouterLog, refusals: RefusalFile) -> None:
    for line in log.others():
        say(line, error=True)
    refusals.write(log.counted())


def _say(word_file: Path, word: str) -> None:
    """Let who waits for the router read all of its word or nothing.

    Nobody waits for one that is started again, perhaps on a full disk: that ends no router.
    """
    with contextlib.suppress(OSError), partial_file(word_file) as partial:
        partial.write_text(word, encoding="utf-8")


if __name__ == "__main__":
    run_router()
