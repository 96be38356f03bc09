"""The recorder process: what the vehicle sends, and the state estimated from it, to MCAP files.

`python -m foretwin.telemetry.processes.recorder --setup FILE` (`RecorderSetup`).
"""

from __future__ import annotations

import contextlib
import logging
import os
import threading
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

from foretwin.contracts.bus import Bus, Mailbox, Received, Reply
from foretwin.contracts.drive import DriveEnd, InfoRequest
from foretwin.contracts.guard import Refused
from foretwin.contracts.keys import TELEMETRY_CHANNELS
from foretwin.contracts.process import ProcessLife, run_process
from foretwin.contracts.setup import RecorderSetup
from foretwin.contracts.simulation import Event
from foretwin.contracts.trace import traced
from foretwin.telemetry.processes.missed import MissedSamples
from foretwin.telemetry.processes.recording import SOURCE, DriveRecording
from foretwin.telemetry.ros_messages.parts import typestore

DEPTH = 20_000
"""Messages that may wait: more than a minute of a car at 300 messages a second."""
_WAIT_S = 0.1
_GATHER_S = 0.05
"""Messages are taken in portions: waking up for each of them costs more than writing it."""
_NICENESS = 10
_AT_ONCE, _BEHIND = 500, 1000
"""A portion; and so many waiting are seconds of a car: who is so far behind hurries."""
_FLUSH_EVERY_S = 1.0
_ASK_EVERY_S = 1.0
_LAST_WORDS_S, _BACKLOG_S = 0.5, 4.0
"""How long messages are still taken after the end of the run, and then what has come by then is
written; in lock step as long as some come."""

log = logging.getLogger("foretwin.telemetry.processes.recorder")


class RecorderProcess:
    """Carries messages from the bus to a DriveRecording: `step` a moment, `run` until the end.

    `life` tells when that is.
    """

    def __init__(
        self,
        recording: DriveRecording,
        *,
        bus: Bus,
        life: ProcessLife,
        run_id: str,
        vehicle_id: str,
        lossless: bool,
        mono_s: Callable[[], float] = time.monotonic,
    ) -> None:
        self._recording = recording
        self._bus, self._life = bus, life
        self._run_id = run_id
        self._vehicle_id = vehicle_id
        self._mono_s = mono_s
        self._lossless = lossless
        self._messages = Mailbox(DEPTH, when_full="block" if lossless else "drop_oldest")
        # Apart, so that a flood of samples never drops an answer.
        self._answers = Mailbox(64)
        # Who follows another has asked for all as it began: what is missing yet will not come.
        follows = bool(recording.tally.recorded)
        self._missed = MissedSamples(first_s=0.0) if follows else MissedSamples()
        self._reported_lost = 0
        self._asked_s: float | None = None
        self._informed = False
        self._flushed_s = mono_s()
        self._stamp_ns = 0
        for channel in (*TELEMETRY_CHANNELS, "state", "injection"):
            bus.subscribe(channel, self._messages, recover=True, vehicle=vehicle_id)
        self._publish(recording.started())
        life.ready()

    def run(self) -> None:
        """Record until the run is over, giving way while little waits.

        Not the bus's threads: a message that they do not fetch in time is lost. Nor this one, which
        writes itself where much waits: on a machine that others keep busy all of it would be lost.
        """
        with ThreadPoolExecutor(1, initializer=_give_way) as calm:
            goes_on = True
            while goes_on:
                behind = len(self._messages) > _BEHIND
                goes_on = self.step() if behind else calm.submit(self.step).result()
                if not (self._lossless or behind):
                    time.sleep(_GATHER_S)
        self.finish()

    def step(self) -> bool:
        """Take what waits, or wait a moment; return False when it is time to finish."""
        self._take_messages(self._messages.take(_WAIT_S))
        while (item := self._answers.take()) is not None:
            self._take_answer(item)
        now_s = self._mono_s()
        self._ask_for_info(now_s)
        if now_s - self._flushed_s >= _FLUSH_EVERY_S:
            self._flushed_s = now_s
            self._publish(self._recording.flush())
            self._ask_for_missed()
            self._report_losses()
        return not self._life.over

    def finish(self) -> None:
        """Write what still waits or is on its way, and end the file.

        Live for half a second at most, and what has come by then; in lock step nothing may be
        missing.
        """
        until_s = self._mono_s() + _LAST_WORDS_S
        while self._lossless or self._mono_s() < until_s:
            item = self._messages.take_last(_WAIT_S)
            if item is None:
                break
            self._take_messages(item)
        until_s, behind = self._mono_s() + _BACKLOG_S, len(self._messages)
        while behind > 0 and self._mono_s() < until_s:
            self._take_messages(self._messages.take())
            behind -= _AT_ONCE + 1
        left = len(self._messages)
        self._messages.close()
        self._report_losses(at_the_end=True)
        # Told to end by itself, another one goes on: in lock step nobody does.
        last = self._lossless or self._life.run_ended
        self._publish(self._recording.finish(last=last))
        log.info(
            "recorded %s; unwritten %s, refused %s, missing %d, dropped %d, unreadable %d, left %d",
            self._recording.tally.recorded,
            self._recording.tally.unwritten,
            self._recording.tally.refused,
            self._recording.missing,
            self._messages.dropped,
            len(self._life.refusals),
            left,
        )

    def _take_messages(self, item: Any | None) -> None:
        """Write `item` and what waits behind it, a portion at most."""
        for _ in range(_AT_ONCE):
            if item is None:
                return
            self._write(item)
            item = self._messages.take()
        if item is not None:
            self._write(item)

    @traced("write")
    def _write(self, item: Received) -> None:
        try:
            envelope = item.envelope()
        except Refused as refused:
            if refused.header is not None:
                numbered = {"sender": item.sender, **refused.header._asdict()}
                self._recording.refuse(item.channel, **numbered)
            if text := self._life.refusals.take(refused):
                log.warning("%s", text)
            return
        message = envelope.message
        self._stamp_ns = message.stamp_ns
        numbered = {"sender": item.sender, "seq": envelope.seq, "sent_ns": envelope.sent_ns}
        self._publish(self._recording.add(item.channel, message, **numbered))
        if isinstance(message, DriveEnd):
            self._ask_for_missed(at_once=True)

    def _ask_for_missed(self, *, at_once: bool = False) -> None:
        if not self._lossless:
            missing = self._recording.tally.numbers.missing
            for channel in self._missed.due(missing, self._mono_s(), at_once=at_once):
                self._bus.recover(channel, vehicle=self._vehicle_id)

    def _take_answer(self, item: Any) -> None:
        if isinstance(item, Reply) and item.message is not None:
            self._informed = True
            self._publish(self._recording.set_info(item.message))

    def _ask_for_info(self, now_s: float) -> None:
        """Ask until the vehicle answers; the recording goes on without."""
        if self._informed or (self._asked_s is not None and now_s - self._asked_s < _ASK_EVERY_S):
            return
        self._asked_s = now_s
        self._bus.request(
            "info", InfoRequest(), self._answers, timeout_s=_ASK_EVERY_S, vehicle=self._vehicle_id
        )

    def _report_losses(self, *, at_the_end: bool = False) -> None:
        # Gaps in the sequence count what the mailbox dropped, and what the bus lost before it.
        # On a busy machine more are lost every second: told when there are twice as many.
        lost = self._recording.missing
        enough = self._reported_lost if at_the_end else 2 * self._reported_lost
        if lost > enough:
            self._reported_lost = lost
            text = (
                f"{lost} messages are missing in the recording so far"
                f" ({self._messages.dropped} dropped since disk or processor is slow, the rest by"
                " the bus)"
            )
            log.warning(text)
            event = Event(stamp_ns=self._stamp_ns, level="warning", source=SOURCE, text=text)
            self._publish([event])

    def _publish(self, events: list[Event]) -> None:
        for event in events:
            self._bus.publish("event", event, run=self._run_id)


def serve(setup: RecorderSetup, bus: Bus, life: ProcessLife) -> None:
    """Record until the run is over."""
    typestore()  # Costs a third of a second: before the first message, not at it.
    process = RecorderProcess(
        DriveRecording(Path(setup.file), roll=setup.roll),
        bus=bus,
        life=life,
        run_id=setup.run_id,
        vehicle_id=setup.vehicle_id,
        lossless=setup.bus.lossless,
    )
    process.run()


def _give_way() -> None:
    """Let this thread, which writes for later, give way to who is waited for."""
    with contextlib.suppress(OSError):
        os.setpriority(os.PRIO_PROCESS, threading.get_native_id(), _NICENESS)


if __name__ == "__main__":
    run_process(RecorderSetup, serve)
