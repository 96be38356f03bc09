"""What asks a process to end: SIGTERM, and SIGHUP as a closed terminal sends it, alike."""

from __future__ import annotations

import errno
import os
import signal
import termios
from collections.abc import Callable

END_SIGNALS = signal.SIGTERM, signal.SIGHUP
_SCREEN = 1, 2


def on_end_signals(handle: Callable[[], object]) -> None:
    """Call `handle` at each of these signals; under nohup a closed terminal ends nothing."""

    def take(number: int, _: object) -> None:
        if number == signal.SIGHUP:
            leave_closed_terminal()
        handle()

    for number in END_SIGNALS:
        if number == signal.SIGTERM or signal.getsignal(number) != signal.SIG_IGN:
            signal.signal(number, take)


def ignore_end_signals() -> None:
    """Let none of these signals do anything any more."""
    for number in END_SIGNALS:
        signal.signal(number, signal.SIG_IGN)


def leave_closed_terminal() -> None:
    """Let what is still said go nowhere: words to a terminal that is gone are errors, and an error
    in the middle of an orderly end would be the end of the order."""
    for descriptor in _SCREEN:
        try:
            termios.tcgetattr(descriptor)
        except termios.error as error:
            if error.args[0] == errno.EIO:
                nowhere = os.open(os.devnull, os.O_WRONLY)
                os.dup2(nowhere, descriptor)
                os.close(nowhere)
