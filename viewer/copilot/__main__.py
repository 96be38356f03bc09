"""The co-pilot display's process: `python -m foretwin.viewer.copilot --setup FILE`; `--replay RUN`
shows again what a run's display showed.

It listens to the bus, makes a frame five times a second, and hands it to whoever looks. The drive
never waits for it: what it does not take in time is forgotten, and it may die and be started again.
"""

from __future__ import annotations

import argparse
import logging
import sys
import threading
import time
import uuid
from pathlib import Path

import msgspec

from foretwin.contracts.bus import Alive, Bus, BusUnreachable, Mailbox, Received, ZenohBus, ask
from foretwin.contracts.codec import read_message
from foretwin.contracts.end_signals import on_end_signals
from foretwin.contracts.errors import UserError
from foretwin.contracts.guard import Refused, is_identifier
from foretwin.contracts.keys import alive_key, process_of_alive_key
from foretwin.contracts.marks import MarkReply, MarkRequest
from foretwin.contracts.page_address import USUAL_PORT, page_address, page_key
from foretwin.contracts.process import ProcessLife, run_process
from foretwin.contracts.setup import CopilotSetup
from foretwin.contracts.terminal import say
from foretwin.contracts.tuning import SetReply, SetRequest
from foretwin.contracts.world import World
from foretwin.viewer.copilot.frames_file import FramesWriter
from foretwin.viewer.copilot.junction_plan import junction_plan
from foretwin.viewer.copilot.now import DriveNow
from foretwin.viewer.copilot.replayed import replay
from foretwin.viewer.copilot.server import (
    CannotError,
    ChangeAsked,
    CopilotServer,
    MarkAsked,
    PageActions,
    page_app,
)
from foretwin.viewer.drive_start import start_of_drive

MAILBOX_DEPTH = 4096
FRAME_S = 0.2
"""Between two frames: an alarm is on the page within half a second."""
NEWEST_COUNTS = frozenset({"state", "mirror", "objects", "progress"})
"""Of these channels only the newest message of a turn is decoded."""
MARK_S, CHANGE_S = 5.0, 30.0
"""What the drive may take to answer."""
LEAVE_S = 1.5

_log = logging.getLogger("copilot")


class Display:
    """The drive as it is shown, between bus and server."""

    def __init__(self, setup: CopilotSetup, bus: Bus, life: ProcessLife) -> None:
        self._setup, self._bus, self._life = setup, bus, life
        self._messages = Mailbox(MAILBOX_DEPTH)
        self._lock = threading.Lock()
        """Held while what is known changes: pages ask for plans from threads of their own."""
        self._now = DriveNow(
            drive_frame=setup.drive_frame,
            find_start=lambda first_ns: start_of_drive(
                bus, setup.vehicle_id, told_ns=setup.start_stamp_ns, first_stamp_ns=first_ns
            ),
            load_world=self._load_world,
            now_s=time.monotonic(),
        )
        self._plans: dict[str, bytes] = {}
        self._frame = b"{}"
        file = setup.frames_file
        self._kept = None if file is None else FramesWriter(Path(file), time.monotonic())
        for channel in self._now.channels:
            bus.subscribe(channel, self._messages, vehicle=setup.vehicle_id, run=setup.run_id)
        bus.watch_alive(alive_key(run=setup.run_id, process="*"), self._messages)

    def turn(self) -> bytes:
        """Take what came and return the frame that shows it."""
        newest: dict[str, Received] = {}
        with self._lock:
            for _ in range(len(self._messages)):
                item = self._messages.take()
                if isinstance(item, Alive):
                    self._alive(item)
                elif isinstance(item, Received):
                    if item.channel in NEWEST_COUNTS:
                        newest[item.channel] = item
                    else:
                        self._take(item)
            for item in newest.values():
                self._take(item)
            frame = self._now.frame(time.monotonic(), linked=self._bus.connected)
        self._frame = msgspec.json.encode(frame)
        if self._kept is not None and frame.pose is not None:
            self._kept.add(self._frame, time.monotonic())
        return self._frame

    def _take(self, item: Received) -> None:
        try:
            self._now.take(item.channel, item.message(), item.received_mono_ns / 1e9)
        except Refused as refused:
            if text := self._life.refusals.take(refused):
                _log.warning("%s", text)
        except Exception:  # one odd message must not end the display
            _log.exception("a message on %s cannot be shown", item.channel)

    def _alive(self, item: Alive) -> None:
        process_id = process_of_alive_key(item.key)
        if is_identifier(process_id) and process_id != self._setup.process_id:
            self._now.alerts.alive(process_id, up=item.up)

    def ended(self, why: str) -> bytes:
        """Return the last frame: the run is over, or this display ends."""
        self.turn()
        self._now.alerts.end(why)
        frame = self.turn()
        if self._kept is not None:
            self._kept.write()
            if self._kept.lost:
                _log.warning("%d frames could not be written", self._kept.lost)
        return frame

    @property
    def actions(self) -> PageActions:
        """What pages may ask for."""
        return PageActions(
            frame_at=self._frame_at,
            plan_of=self._plan_of,
            mark=self._mark,
            change=None if self._setup.operator is None else self._change,
        )

    def _frame_at(self, drive_s: float | None) -> bytes:
        if drive_s is not None:
            raise CannotError("this is no recording: there is only now")
        return self._frame

    def _plan_of(self, world_id: str) -> bytes | None:
        if world_id not in self._plans:
            with self._lock:
                world = self._now.world(world_id)
            if world is None:
                return None
            while len(self._plans) >= 4:
                del self._plans[next(iter(self._plans))]
            self._plans[world_id] = msgspec.json.encode(
                junction_plan(world, self._setup.drive_frame)
            )
        return self._plans[world_id]

    def _load_world(self, world_id: str) -> World:
        if not is_identifier(world_id):
            raise FileNotFoundError(f"{world_id!r} is no name of a World")
        if self._setup.worlds_dir is not None:
            return read_message(Path(self._setup.worlds_dir) / f"{world_id}.world", World)
        raise FileNotFoundError(f"World {world_id} is not on this machine")

    def _mark(self, asked: MarkAsked) -> MarkReply:
        request = MarkRequest(
            mark_id=asked.mark_id or uuid.uuid4().hex,
            by=asked.by or self._setup.seat,
            utc_ns=time.time_ns(),
            note=asked.note,
            stamp_ns=asked.stamp_ns,
        )
        try:
            reply: MarkReply = ask(
                self._bus, "mark", request, timeout_s=MARK_S, run=self._setup.run_id
            )
        except TimeoutError as silent:
            raise CannotError(f"the drive does not answer: {silent}") from None
        self._now.marks = reply.count
        return reply

    def _change(self, asked: ChangeAsked) -> str:
        assert self._setup.operator is not None
        request = SetRequest(key=asked.key, value=asked.value)
        try:
            with ZenohBus(self._setup.operator) as bus:
                reply: SetReply = ask(
                    bus, "set", request, timeout_s=CHANGE_S, run=self._setup.run_id
                )
        except (TimeoutError, BusUnreachable) as silent:
            raise CannotError(f"the drive does not answer: {silent}") from None
        if not reply.done:
            raise CannotError(reply.text)
        return reply.text


def serve(setup: CopilotSetup, bus: Bus, life: ProcessLife) -> None:
    """Show the drive until it is over."""
    display = Display(setup, bus, life)
    key = page_key(setup.bus, setup.run_id)
    about = {
        "run": setup.run_id,
        "seat": setup.seat,
        "vehicle": setup.vehicle_id,
        "attribution": setup.attribution,
    }
    server = CopilotServer(
        lambda feed: page_app(key, feed, display.actions, about=about),
        host=setup.host,
        port=setup.port,
        tls=setup.page_tls,
    )
    server.start()
    if setup.awaited:
        life.ready()
    else:
        secure = setup.page_tls is not None
        address = page_address(key, host=setup.host, port=setup.port, secure=secure)
        say(f"{setup.run_id}: co-pilot display: {address}")
    while not life.over:
        begun_s = time.monotonic()
        server.publish(display.turn(), begun_s)
        life.terminated.wait(FRAME_S)
    why = "the run has ended" if life.run_ended else "the display was ended"
    server.publish(display.ended(why))
    server.close(LEAVE_S)


def main(arguments: list[str] | None = None) -> int:
    """Run the display; returns only of a replay, or where it cannot, with the exit code."""
    parser = argparse.ArgumentParser(prog="python -m foretwin.viewer.copilot", description=__doc__)
    what = parser.add_mutually_exclusive_group(required=True)
    what.add_argument("--setup", type=Path, metavar="FILE", help="a CopilotSetup as JSON")
    what.add_argument("--replay", type=Path, metavar="RUN", help="the folder of a run")
    parser.add_argument("--port", type=int, default=USUAL_PORT, help="of a replay")
    given = parser.parse_args(arguments)
    if given.replay is None:
        run_process(CopilotSetup, serve, ["--setup", str(given.setup)])
        return 1
    ended = threading.Event()
    on_end_signals(ended.set)
    try:
        replay(given.replay, given.port, ended)
    except (UserError, OSError) as problem:
        say(f"foretwin: {problem}", error=True)
        return 2
    except KeyboardInterrupt:
        return 130
    return 0


if __name__ == "__main__":
    sys.exit(main())
