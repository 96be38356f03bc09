"""Whether the live view keeps up with the drive, and what is said where it does not."""

from __future__ import annotations

import logging
import threading
import time
from collections.abc import Callable
from typing import Literal, NamedTuple

from rerun.experimental import ViewerClient

from foretwin.viewer.rows import TIMELINE

BEHIND_S, CAUGHT_UP_S = 3.0, 1.5
"""Chosen: whoever sits in the car notices three seconds. Said again only after it was over."""
ASK_PERIOD_S = 5.0

_log = logging.getLogger(__name__)


class Said(NamedTuple):
    """Something to tell of the live view."""

    level: Literal["info", "warning"]
    text: str


class KeepingUp:
    """Judges how far behind the drive the live view is; says each change once."""

    def __init__(self) -> None:
        self._behind = False
        self._told_dropped = 0

    def look(self, *, behind_s: float, dropped: int) -> list[Said]:
        """Take by how much drive time the view is behind, and how many rows it has missed so far;
        returns what is new."""
        said = []
        if behind_s > BEHIND_S and not self._behind:
            self._behind = True
            text = f"the live view is {behind_s:.0f} s behind the drive; the recording is not"
            said.append(Said("warning", text))
        elif behind_s < CAUGHT_UP_S and self._behind:
            self._behind = False
            said.append(Said("info", "the live view keeps up with the drive again"))
        # Each time twice as many: who falls behind for good would else be told every second.
        if dropped >= max(1, 2 * self._told_dropped):
            self._told_dropped = dropped
            text = f"the live view was too slow for {dropped} rows; the recording has them"
            said.append(Said("warning", text))
        return said


class WindowLag:
    """Asks a window of Rerun now and then up to which drive time it has the recording.

    A page in a browser answers no such questions; then `behind_s` stays 0.
    """

    def __init__(
        self,
        address: str,
        recording_id: str,
        newest_ns: Callable[[], int],
        *,
        connect: Callable[[str], ViewerClient] = ViewerClient.connect,
        period_s: float = ASK_PERIOD_S,
    ) -> None:
        """`newest_ns` returns the drive time of what was sent last."""
        self.behind_s = 0.0
        self._address, self._recording_id = address, recording_id
        self._newest_ns, self._connect, self._period_s = newest_ns, connect, period_s
        threading.Thread(target=self._ask, name="lag", daemon=True).start()

    def _ask(self) -> None:
        try:
            client = self._connect(self._address)
            while True:
                sent_ns = self._newest_ns()
                until_ns = self._until(client)
                self.behind_s = 0.0 if until_ns is None else max(0.0, (sent_ns - until_ns) / 1e9)
                time.sleep(self._period_s)
        except Exception as problem:  # a window that is closed, or a page
            self.behind_s = 0.0
            _log.info("the live view does not say how far it is: %s", problem)

    def _until(self, client: ViewerClient) -> int | None:
        ends = [
            timeline.end
            for recording in client.get_state().recordings
            if recording.store_id.endswith(f":{self._recording_id}")
            for timeline in recording.timelines
            if timeline.name == TIMELINE and timeline.end is not None
        ]
        return max(ends, default=None)
