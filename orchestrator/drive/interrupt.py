"""Ctrl-C, SIGTERM and a closed terminal, remembered for the loops: nothing is torn away."""

from __future__ import annotations

import signal

from foretwin.contracts.end_signals import on_end_signals


class Interruption:
    """Takes these signals for its process from now on; `asked` once one has come."""

    def __init__(self) -> None:
        self.asked = False
        signal.signal(signal.SIGINT, lambda *_: self._remember())
        on_end_signals(self._remember)

    def _remember(self) -> None:
        self.asked = True
