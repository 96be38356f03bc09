"""The latest frame, handed to any number of pages: who is slow misses frames and holds up nobody.

Nothing is queued: each page takes the newest frame whenever it has taken the one before.
"""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator

MOST_PAGES = 16
"""More would be no seats of a car."""
BEGIN_AGAIN_MS = 500
"""So soon a page calls again after its link was lost."""


class TooManyPagesError(RuntimeError):
    """No further page can be served."""


class Feed:
    """Lives on one event loop; `publish` is called there too."""

    def __init__(self) -> None:
        self._newest, self._made_s, self._number = b"", 0.0, 0
        self._news = asyncio.Event()
        self._over = False
        self.pages = 0
        """How many pages listen."""

    def publish(self, frame: bytes, made_s: float) -> None:
        """Let `frame`, one line of JSON, be the newest one; it goes out with when it was made."""
        self._newest, self._made_s = frame, made_s
        self._number += 1
        self._wake()

    def close(self) -> None:
        """Let each page have the newest frame and go."""
        self._over = True
        self._wake()

    def _wake(self) -> None:
        self._news.set()
        self._news = asyncio.Event()

    async def events(self) -> AsyncIterator[bytes]:
        """Yield the newest frame as server-sent events, until the feed is closed.

        Raises TooManyPagesError, before the first of them.
        """
        if self.pages >= MOST_PAGES:
            raise TooManyPagesError
        self.pages += 1
        try:
            yield f"retry: {BEGIN_AGAIN_MS}\n\n".encode()
            seen = 0
            while True:
                if self._number > seen:
                    seen = self._number
                    yield b"id: %.3f\ndata: %b\n\n" % (self._made_s, self._newest)
                elif self._over:
                    return
                else:
                    await self._news.wait()
        finally:
            self.pages -= 1
