"""What came from outside and cannot be used: told once of each kind, counted for run.json."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any, Literal

from foretwin.contracts.guard import Refused
from foretwin.contracts.mailbox import Reply
from foretwin.contracts.refusals import Refusals
from foretwin.orchestrator.instructions import Notice
from foretwin.orchestrator.record.refused_elsewhere import lines_to_tell, refused_elsewhere

_LOOK_S = 1.0


class RefusalHandler:
    """Counts refusals of one drive by sender and reason, and tells the first of each: its own, and
    those that other processes write into the folder `processes`."""

    def __init__(self, tell: Callable[[Notice], None], processes: Path) -> None:
        self._tell, self._processes = tell, processes
        self.counted = Refusals()
        self.told: set[tuple[bool, str, str]] = set()
        """Of others: whether the router did, whom, and for what."""
        self._next_look_s = -math.inf

    def take(self, refused: Refused) -> None:
        """Count something that was not let in."""
        self._say("error", self.counted.take(refused))

    def take_reply(self, reply: Reply) -> None:
        """Count an answer that was not let in; of one to a job its worker is told of, as sick."""
        if reply.refused is not None and reply.channel == "job":
            self.counted.take(reply.refused)
        elif reply.refused is not None:
            self.take(reply.refused)

    def leave_out(self, key: str, count: int) -> None:
        """Count road users that were left out of a message on `key`."""
        self._say("warning", self.counted.note(key, "road users that cannot be", count=count))

    def look(self, now_s: float) -> None:
        """Tell what others have refused since; call it often."""
        if now_s < self._next_look_s:
            return
        self._next_look_s = now_s + _LOOK_S
        self.look_now()

    def look_now(self) -> None:
        """Tell what others have refused since the last look."""
        for line in lines_to_tell(self._processes):
            kind = line.by_router, line.sender, line.reason
            known = not line.by_router and self.counted.knows(line.sender, line.reason)
            if kind not in self.told and not known:
                self.told.add(kind)
                self._say("error", line.text)

    def record(self) -> dict[str, Any]:
        """Return what run.json says of refusals."""
        return {"refused": self.counted.record(), **refused_elsewhere(self._processes)}

    def _say(self, level: Literal["warning", "error"], text: str | None) -> None:
        if text is not None:
            self._tell(Notice(level, text))
