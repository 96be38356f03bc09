"""SIGTERM and SIGHUP are one; nohup is respected."""

from __future__ import annotations

import os
import signal
from collections.abc import Iterator

import pytest

from foretwin.contracts.end_signals import END_SIGNALS, ignore_end_signals, on_end_signals


@pytest.fixture(autouse=True)
def _as_it_was() -> Iterator[None]:
    before = {number: signal.getsignal(number) for number in END_SIGNALS}
    yield
    for number, handler in before.items():
        signal.signal(number, handler)


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGHUP])
def test_each_of_them_is_taken(number: signal.Signals) -> None:
    taken: list[str] = []
    on_end_signals(lambda: taken.append("asked"))
    os.kill(os.getpid(), number)

    assert taken == ["asked"]


def test_under_nohup_a_closed_terminal_ends_nothing() -> None:
    signal.signal(signal.SIGHUP, signal.SIG_IGN)
    taken: list[str] = []
    on_end_signals(lambda: taken.append("asked"))
    os.kill(os.getpid(), signal.SIGHUP)
    assert taken == []

    os.kill(os.getpid(), signal.SIGTERM)
    assert taken == ["asked"]


def test_who_ends_already_is_not_asked_again() -> None:
    taken: list[str] = []
    on_end_signals(lambda: taken.append("asked"))
    ignore_end_signals()
    for number in END_SIGNALS:
        os.kill(os.getpid(), number)

    assert taken == []
