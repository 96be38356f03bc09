"""The viewer process: `python -m foretwin.viewer --setup FILE`; `--open RRD` shows a recording."""

from __future__ import annotations

import argparse
import logging
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

from foretwin.contracts.bus import Bus, Mailbox, Received
from foretwin.contracts.codec import read_message
from foretwin.contracts.guard import Refused
from foretwin.contracts.process import ProcessLife, run_process
from foretwin.contracts.refusals import Refusals
from foretwin.contracts.roads_shown import RoadsShown
from foretwin.contracts.segments import (
    next_number,
    segment_file,
)
from foretwin.contracts.setup import ViewerSetup
from foretwin.contracts.terminal import say
from foretwin.contracts.trace import span, traced
from foretwin.viewer.blueprint import drive_blueprint
from foretwin.viewer.drive_start import start_of_drive
from foretwin.viewer.keeping_up import KeepingUp
from foretwin.viewer.live_viewer import (
    live_viewer,
)
from foretwin.viewer.log_lot import rows_of_lot
from foretwin.viewer.monitor import Monitor, read_world
from foretwin.viewer.rows import Row
from foretwin.viewer.showing import show
from foretwin.viewer.sinks import FileStream, LiveStream

MAILBOX_DEPTH = 4096
FLUSH_PERIOD_S = 0.9
GATHER_S = 0.03
"""Messages are taken in portions: waking up for each costs more than the eye gains."""


class Farewell(NamedTuple):
    """How long leaving may take: emptying the mailbox, and sending what the window lacks.

    The mailbox counts as empty after `quiet_s` without a message, since keys may lag behind.
    """

    quiet_s: float
    drain_s: float
    live_s: float


ENDED = Farewell(quiet_s=0.25, drain_s=6.0, live_s=1.0)
COMPLETE = ENDED._replace(drain_s=60.0)
"""In lock step nothing may be missing."""
HURRIED = Farewell(quiet_s=0.05, drain_s=0.4, live_s=0.1)
"""When told to leave, or left alone: Ctrl-C ends a whole run within 3 s."""

_log = logging.getLogger("viewer")


class Recorder:
    """Takes messages from a mailbox and writes their rows to the file and the live stream."""

    def __init__(
        self,
        setup: ViewerSetup,
        messages: Mailbox,
        find_start: Callable[[int], int],
        refusals: Refusals,
    ) -> None:
        self._messages = messages
        self._reported_dropped = 0
        self._refusals = refusals
        self._reported_window = False
        self._keeping_up = KeepingUp()
        self._flushed_s = time.monotonic()
        self._setup = setup
        self._blueprint = drive_blueprint(setup.layout)
        self._monitor = self._new_monitor(find_start)
        self.channels = self._monitor.channels
        self._live_viewer = live_viewer(setup.live, page_port=setup.page_port)
        self._live = (
            None
            if self._live_viewer is None
            else LiveStream(
                self._live_viewer.open, recording_id=setup.run_id, blueprint=self._blueprint
            )
        )
        self._active: Received | None = None
        """The World that was said to count last."""
        self._open_part()
        self._write(self._monitor.opening())
        self._file.flush()

    def _new_monitor(self, find_start: Callable[[int], int]) -> Monitor:
        setup = self._setup
        return Monitor(
            drive_frame=setup.drive_frame,
            find_start=find_start,
            title=setup.title,
            attribution=setup.attribution,
            load_world=lambda world_id: read_world(Path(setup.worlds_dir), world_id),
            roads=_roads(setup),
            lot=()
            if setup.anchor is None
            else rows_of_lot(setup.anchor, setup.fence, drive_frame=setup.drive_frame),
            clock=None if setup.live == "none" else lambda: time.strftime("%H:%M:%S"),
            mono_s=time.monotonic,
        )

    def _open_part(self) -> None:
        # What one that died has shown is left as it is.
        first = Path(self._setup.file)
        self._path, self._begun_s = segment_file(first, next_number(first)), time.monotonic()
        self._file = FileStream(
            self._path,
            recording_id=self._setup.run_id,
            title=self._setup.title,
            blueprint=self._blueprint,
        )

    def _roll(self) -> None:
        """Begin another file where this one is large; each can be shown without the others."""
        size, age_s = self._path.stat().st_size, time.monotonic() - self._begun_s
        start_ns = self._monitor.start_ns
        if start_ns is None or not self._setup.roll.is_due(size_bytes=size, age_s=age_s):
            return
        self._file.close()
        self._open_part()
        self._monitor = self._new_monitor(lambda _: start_ns)
        self._file.write(self._monitor.opening())
        if self._active is not None:
            self._file.write(self._monitor.handle("active_world", self._active.message()))

    def take_one(self, timeout_s: float) -> bool:
        """Write the rows of one message; False where none came in time."""
        return self._take(self._messages.take(timeout_s))

    def _take(self, item: object) -> bool:
        if isinstance(item, Received):
            try:
                with span(item.channel):
                    rows = self._monitor.handle(item.channel, item.message())
                if item.channel == "active_world":
                    self._active = item
            except Refused as refused:
                text = self._refusals.take(refused)
                rows = self._monitor.note("error", text) if text else []
            self._write(rows)
        if time.monotonic() - self._flushed_s > FLUSH_PERIOD_S:
            self._report_troubles()
            self._file.flush()
            self._roll()
            self._flushed_s = time.monotonic()
        return item is not None

    def drain(self, farewell: Farewell) -> None:
        """Write what still lies in the mailbox, in bounded time."""
        deadline_s = time.monotonic() + farewell.drain_s
        while self._take(self._messages.take_last(farewell.quiet_s)):
            if time.monotonic() > deadline_s:
                break

    def close(self, farewell: Farewell, *, keep_window: bool) -> None:
        """Complete the file, then give the live view a moment; bounded even if it is frozen."""
        self._report_troubles()
        self._file.close()
        if self._live is not None and self._live_viewer is not None:
            self._live.close(farewell.live_s)
            if self._live.dropped:
                _log.info("the live view missed %d rows; the file has them", self._live.dropped)
            self._live_viewer.end(keep_window)

    @traced("write rows")
    def _write(self, rows: list[Row]) -> None:
        self._file.write(rows)
        if self._live is not None:
            self._live.write(rows)

    def _report_troubles(self) -> None:
        if self._live is not None and self._live.failed and not self._reported_window:
            self._reported_window = True
            self._write(self._monitor.note("warning", f"no live view: {self._live.failed}"))
        live = self._live
        if live is not None and not live.failed and not self._setup.bus.lossless:
            for said in self._keeping_up.look(behind_s=live.behind_s, dropped=live.dropped):
                self._write(self._monitor.note(said.level, said.text))
        dropped = self._messages.dropped
        if dropped > self._reported_dropped:
            text = f"{dropped - self._reported_dropped} messages dropped, {dropped} in all"
            _log.warning(text)
            self._write(self._monitor.note("warning", text))
            self._reported_dropped = dropped


def _roads(setup: ViewerSetup) -> RoadsShown | None:
    if setup.roads is None:
        return None
    try:
        return read_message(Path(setup.roads), RoadsShown)
    except (OSError, ValueError) as problem:
        _log.warning("the map around the Worlds is not shown: %s", problem)
        return None


def serve(setup: ViewerSetup, bus: Bus, life: ProcessLife) -> None:
    """Record until the run is over."""
    messages = Mailbox(MAILBOX_DEPTH, when_full="block" if setup.bus.lossless else "drop_oldest")

    def find_start(first_stamp_ns: int) -> int:
        told_ns = setup.start_stamp_ns
        return start_of_drive(bus, setup.vehicle_id, told_ns=told_ns, first_stamp_ns=first_stamp_ns)

    recorder = Recorder(setup, messages, find_start, life.refusals)
    for channel in recorder.channels:
        bus.subscribe(channel, messages, vehicle=setup.vehicle_id, run=setup.run_id)
    life.ready()
    while not life.over:
        recorder.take_one(0.1)
        for _ in range(len(messages)):
            recorder.take_one(0.0)
        if not setup.bus.lossless:
            time.sleep(GATHER_S)
    ended = COMPLETE if setup.bus.lossless else ENDED
    farewell = ended if life.run_ended else HURRIED
    recorder.drain(farewell)
    messages.close()
    recorder.close(farewell, keep_window=life.run_ended)


def main(arguments: list[str] | None = None) -> int:
    """Run the viewer; returns only where it cannot, with the exit code."""
    parser = argparse.ArgumentParser(prog="python -m foretwin.viewer", description=__doc__)
    what = parser.add_mutually_exclusive_group(required=True)
    what.add_argument("--setup", type=Path, metavar="FILE", help="a ViewerSetup as JSON")
    what.add_argument("--open", type=Path, metavar="RRD", help="show an existing recording")
    parser.add_argument("--layout", help="of --open: a name or a TOML file; default: its own")
    parser.add_argument("--view", choices=("native", "web"), default="native", help="of --open")
    given = parser.parse_args(arguments)
    try:
        if given.open is not None:
            show(given.open, layout=given.layout, view=given.view)
        # Leaves through os._exit: Rerun's flush at exit never ends with a frozen viewer.
        run_process(ViewerSetup, serve, ["--setup", str(given.setup)])
    except (OSError, ValueError) as problem:
        say(f"viewer: {problem}", error=True)
        return 2
    return 1


if __name__ == "__main__":
    sys.exit(main())
