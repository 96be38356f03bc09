"""Events that somebody in the car marks: kept as rows, told, and answered with their stamp."""

from __future__ import annotations

import msgspec

from foretwin.contracts.guard import Refused
from foretwin.contracts.mailbox import Request
from foretwin.contracts.marks import MOST_NOTE, EventMark, MarkReply, MarkRequest
from foretwin.contracts.terminal import plain
from foretwin.orchestrator.context import DriveContext
from foretwin.orchestrator.drive.intake import Intake
from foretwin.orchestrator.drive.mission import Mission
from foretwin.orchestrator.instructions import Notice

MOST_IDS = 10_000
"""Marks whose ids are remembered, to be counted once; a drive has some dozens."""
MOST_NAME = 64
"""Characters of an id, and of who marked."""


class MarkHandler:
    """Takes questions of the channel `mark`; one with the id of another adds a note to it."""

    def __init__(self, context: DriveContext, intake: Intake, mission: Mission) -> None:
        self._context, self._intake, self._mission = context, intake, mission
        self._stamps: dict[str, int] = {}

    def take(self, request: Request) -> None:
        """Keep a mark and answer; raises Refused, once answered, for what cannot be one."""
        try:
            asked = _checked(request)
        except Refused as refused:
            request.refuse(plain(str(refused)))
            raise
        again = asked.mark_id in self._stamps
        told_ns = self._stamps.get(asked.mark_id, asked.stamp_ns)
        stamp_ns = self._intake.now_stamp_ns if told_ns is None else told_ns
        if len(self._stamps) < MOST_IDS:
            self._stamps[asked.mark_id] = stamp_ns
        drive_time_s = max(0.0, (stamp_ns - self._intake.start_stamp_ns) / 1e9)
        mark = EventMark(
            mark_id=asked.mark_id,
            stamp_ns=stamp_ns,
            drive_time_s=drive_time_s,
            utc_ns=asked.utc_ns,
            by=asked.by,
            note=asked.note,
        )
        latest = self._intake.latest
        if not again and latest is not None:
            # Of a note that comes later nobody knows any more where the car was.
            here = latest.state.position
            mark = msgspec.structs.replace(
                mark,
                junction_id=self._mission.junction_id,
                lat_deg=here.lat_deg,
                lon_deg=here.lon_deg,
            )
        self._context.tables.add("marks", [msgspec.structs.asdict(mark)])
        note = f": {asked.note}" if asked.note else ""
        text = f"marked at {drive_time_s:.1f} s by {asked.by or 'somebody'}{note}"
        self._context.tell(Notice("info", text))
        count = len(self._stamps)
        request.reply(
            MarkReply(
                mark_id=mark.mark_id, stamp_ns=stamp_ns, drive_time_s=drive_time_s, count=count
            )
        )


def _checked(request: Request) -> MarkRequest:
    asked: MarkRequest = request.message()
    if not 0 < len(asked.mark_id) <= MOST_NAME or len(asked.by) > MOST_NAME:
        raise Refused(request.key, "a mark of no plain id or name")
    if len(asked.note) > MOST_NOTE:
        raise Refused(request.key, "a note too long")
    return asked
