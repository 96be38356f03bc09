"""Tells when a drive's certificates end: a running drive keeps those with which it began."""

from __future__ import annotations

import datetime
from collections.abc import Iterator

_SOON = datetime.timedelta(days=1), datetime.timedelta(minutes=10), datetime.timedelta(0)
"""It is told when so much is left."""


class CertificateEnd:
    """Gives each warning once, and of several that are due the last; `ends` None: never."""

    def __init__(self, ends: datetime.datetime | None) -> None:
        self._ends = ends
        self._told = 0

    def news(self, now: datetime.datetime) -> Iterator[str]:
        """Yield what is to be told now; call it often."""
        if self._ends is None or self._told == len(_SOON):
            return
        left = self._ends - now
        due = sum(left <= soon for soon in _SOON)
        if due > self._told:
            self._told = due
            yield self._text(left)

    def _text(self, left: datetime.timedelta) -> str:
        when = f"{self._ends:%Y-%m-%d %H:%M} UTC"
        if left <= datetime.timedelta(0):
            return f"a certificate of this drive has ended ({when}): its links are closed"
        minutes = -(-left // datetime.timedelta(minutes=1))
        span = f"{minutes // 60} h {minutes % 60} min" if minutes >= 60 else f"{minutes} min"
        return (
            f"a certificate of this drive ends {when}, in {span}: its links close then; before the "
            "next drive make others (foretwin secure show, foretwin secure add)"
        )
