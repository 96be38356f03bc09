"""Keeps the record of a drive: what run.json would say so far, and at the end run.json itself."""

from __future__ import annotations

import contextlib
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from foretwin.contracts.errors import one_line
from foretwin.orchestrator.drive.conductor import Conductor
from foretwin.orchestrator.drive.process_watch import ProcessWatch
from foretwin.orchestrator.drive.run_record import restart_troubles, run_record, samples_heard
from foretwin.orchestrator.drive.supervision import DriveProcesses, Life
from foretwin.orchestrator.record.run_state import (
    RECORD,
    RUNNING,
    made_by_recover,
    write_record,
)
from foretwin.orchestrator.record.so_far import forget_so_far, so_far_bytes

EVERY_S, SHARE = 2.0, 0.01
"""How often it is told so far, and the most of the orchestrator's time that this may take."""


@dataclass(slots=True)
class RecordKeeper:
    """Looks at one drive; the loop calls `look` often."""

    conductor: Conductor
    processes: DriveProcesses
    watch: ProcessWatch
    life: Life
    mono_s: Callable[[], float] = time.monotonic
    _next_s: float = 0.0

    def look(self, now_s: float) -> None:
        """Have it written what run.json would say now, where it is time to."""
        if now_s < self._next_s:
            return
        began_s, heard = self.mono_s(), samples_heard(self.conductor)
        if not any(heard.values()):
            return  # who recovers such a run shall read "unknown", not 0
        self.conductor.tables.keep_so_far(so_far_bytes(self._record(RUNNING), heard))
        took_s = self.mono_s() - began_s
        self._next_s = now_s + max(EVERY_S, took_s / SHARE)

    def write(self, exit_word: str) -> dict[str, Any]:
        """Write run.json, complete; returns what it says, or would say where it cannot be written:
        then that is the last of its troubles."""
        folder = self.conductor.plan.folder
        record = self._record(exit_word)
        try:
            write_record(record, folder / RECORD)
        except OSError as error:
            trouble = f"{RECORD} cannot be written: {one_line(error)}; {made_by_recover(folder)}"
            record["troubles"].append(trouble)
            return record
        with contextlib.suppress(OSError):  # run.json says more, wherever this stays
            forget_so_far(folder)
        return record

    def _record(self, exit_word: str) -> dict[str, Any]:
        now_s, ended_by = time.monotonic(), self.life.ended_by
        lost = restart_troubles(self.conductor.plan, ended_by)
        return run_record(
            self.conductor,
            self.processes.restarted,
            exit_word=exit_word,
            ended_by=ended_by,
            wall_s=now_s - self.life.began_s,
            mono_s=now_s,
            troubles=[*self.watch.troubles, *lost],
        )
