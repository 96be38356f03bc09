"""How a process takes its messages: none is worth the run, and what is refused is counted."""

from __future__ import annotations

import logging
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Protocol

from foretwin.contracts.bus import Mailbox, Received, Request
from foretwin.contracts.errors import one_line
from foretwin.contracts.guard import Refused
from foretwin.contracts.refusals import Refusals
from foretwin.contracts.trace import span

_IDLE_S = 0.2
_LAST_WORDS_S = 0.5
"""How long the messages that are here may take once the run is over; in lock step none is left."""
_QUIET_S = 0.1


class LoopLife(Protocol):
    """Tells whether the run is over: a `ProcessLife` does."""

    @property
    def over(self) -> bool:
        """Whether to finish what is held and leave."""


@contextmanager
def passed_over_where_unfit(
    item: Received | Request, *, refusals: Refusals, log: logging.Logger
) -> Iterator[None]:
    """Log what goes wrong with a message, and refuse it where it is a question; never raises."""
    try:
        yield
    except Refused as refused:
        if text := refusals.take(refused):
            log.warning("%s", text)
        if isinstance(item, Request):
            item.refuse(one_line(refused))
    except Exception as error:
        # The run goes on without it; the traceback is for the log's reader.
        if isinstance(item, Request):
            log.exception("%s refused", item.channel)
            item.refuse(one_line(error))
        else:
            log.exception("message on %s passed over", item.key)


def take_messages(
    mailbox: Mailbox,
    handle: Callable[[Received | Request], None],
    life: LoopLife,
    *,
    lossless: bool,
    gather_s: float = 0.0,
) -> None:
    """Handle messages until the run is over, then those that are there; blocks.

    Live they are taken in portions of `gather_s`; in lock step nothing waits and nothing is lost.
    """
    while not life.over:
        if gather_s and not lossless:
            mailbox.gather(gather_s)
        _take(handle, mailbox.take(_IDLE_S))
        for _ in range(len(mailbox)):
            _take(handle, mailbox.take())
    deadline = time.monotonic() + _LAST_WORDS_S
    while lossless or time.monotonic() < deadline:
        item = mailbox.take_last(_QUIET_S if lossless else 0.0)
        if item is None:
            break
        _take(handle, item)


def _take(handle: Callable[[Received | Request], None], item: object) -> None:
    if isinstance(item, Received | Request):
        with span(item.channel):
            handle(item)
