"""A vehicle on the bus: the thin process under a recorded drive and under the stand-in car.

Nothing downstream can tell which of them, or a real car, sends.
"""

from __future__ import annotations

import logging
import os
import signal
import sys
import time
from collections import Counter
from collections.abc import Callable, Iterator
from pathlib import Path
from types import FrameType
from typing import Any, Protocol, TypeVar

import msgspec

from foretwin.contracts.bus import Alive, Bus, Mailbox, Received, Request, ZenohBus
from foretwin.contracts.codec import SchemaMismatch
from foretwin.contracts.drive import AdvanceReply, DriveEnd, VehicleInfo
from foretwin.contracts.errors import UserError
from foretwin.contracts.keys import alive_key
from foretwin.contracts.process import log_to_file
from foretwin.contracts.setup import ProcessSetup, read_setup

ORCHESTRATOR = "orchestrator"
_TICK_S = 0.005
"""Between two looks at the clock: what a sample may be late."""
_MOST_AT_ONCE_NS = 200_000_000
_IDLE_S = 0.2
_GRACE_S = 1.5
"""How long the orchestrator may be out of sight before it counts as gone."""

log = logging.getLogger("telemetry.vehicle")


class VehicleSource(Protocol):
    """Where samples come from: a recorded drive or a simulated car."""

    @property
    def info(self) -> VehicleInfo:
        """What is known of the vehicle before its first sample."""

    @property
    def first_stamp_ns(self) -> int:
        """Where the drive begins: the stamp that the clock starts at."""

    @property
    def ended(self) -> bool:
        """Whether the last sample has been given."""

    @property
    def skipped_invalid(self) -> int:
        """How many samples were refused so far."""

    def advance(self, until_stamp_ns: int) -> Iterator[tuple[str, msgspec.Struct]]:
        """Yield (channel, message) up to and including the stamp, each once, in stamp order."""


class VehicleProcess:
    """Publishes a source, paced by the monotonic clock or in lock step, and answers questions.

    `speed` is drive seconds per wall second; None is lock step: samples follow `advance` requests
    alone. `step` does what is due and returns; `run` calls it until it is time to leave.
    """

    def __init__(
        self,
        source: VehicleSource,
        *,
        bus: Bus,
        run_id: str,
        process_id: str,
        vehicle_id: str,
        speed: float | None,
        mono_s: Callable[[], float] = time.monotonic,
    ) -> None:
        """Raises ValueError for a speed that is not positive."""
        if speed is not None and not speed > 0.0:
            raise ValueError(f"speed {speed} must be positive; leave it out for lock step")
        self._source = source
        self._bus = bus
        self._vehicle_id = vehicle_id
        self._speed = speed
        self._mono_s = mono_s
        self._mailbox = Mailbox(256)
        self._published: Counter[str] = Counter()
        self._last_stamp_ns = source.first_stamp_ns
        self._given_until_ns = source.first_stamp_ns
        self._started_s: float | None = None
        self._lost_s: float | None = None
        self._behind = False
        self._end_sent = False
        self._stop = False
        bus.serve("info", self._mailbox, vehicle=vehicle_id)
        if speed is None:
            bus.serve("advance", self._mailbox, vehicle=vehicle_id)
        bus.subscribe("run_end", self._mailbox, run=run_id)
        bus.watch_alive(alive_key(run=run_id, process=ORCHESTRATOR), self._mailbox)
        bus.declare_alive(alive_key(run=run_id, process=process_id))

    @property
    def published(self) -> dict[str, int]:
        """Samples published so far by channel."""
        return dict(self._published)

    def stop(self) -> None:
        """Let `run` return soon; safe in a signal handler."""
        self._stop = True

    def run(self) -> None:
        """Work until the run ends, the orchestrator is gone, or `stop` was called."""
        parent = os.getppid()
        while self.step() and os.getppid() == parent:
            pass

    def step(self) -> bool:
        """Answer what was asked, publish what is due, wait a moment; return False to leave."""
        item = self._mailbox.take(self._wait_s())
        while item is not None and not self._stop:
            self._take(item)
            item = self._mailbox.take()
        if self._stop or (self._lost_s is not None and self._mono_s() - self._lost_s > _GRACE_S):
            return False
        if self._speed is not None and self._started_s is not None and not self._end_sent:
            elapsed_ns = int((self._mono_s() - self._started_s) * self._speed * 1e9)
            due_ns = self._source.first_stamp_ns + elapsed_ns
            # Questions are answered between portions, also by a source that cannot keep up.
            self._publish_until(min(due_ns, self._given_until_ns + _MOST_AT_ONCE_NS))
            self._behind = self._given_until_ns < due_ns
        return True

    def _wait_s(self) -> float:
        pacing = self._speed is not None and self._started_s is not None and not self._end_sent
        if not pacing:
            return _IDLE_S
        return 0.0 if self._behind else _TICK_S

    def _take(self, item: Any) -> None:
        match item:
            case Alive(up=True):
                self._lost_s = None
                if self._started_s is None:
                    log.info("the orchestrator is ready")
                    self._started_s = self._mono_s()
            case Alive():
                self._lost_s = self._mono_s()
            case Received(channel="run_end"):
                log.info("the run is over")
                self._stop = True
            case Request(channel="info"):
                item.reply(self._source.info)
            case Request(channel="advance"):
                try:
                    until_ns = item.message().until_stamp_ns
                except SchemaMismatch as problem:
                    item.refuse(str(problem))
                    return
                self._publish_until(until_ns)
                item.reply(AdvanceReply(published=self.published, ended=self._end_sent))

    def _publish_until(self, until_stamp_ns: int) -> None:
        for channel, message in self._source.advance(until_stamp_ns):
            self._bus.publish(channel, message, vehicle=self._vehicle_id)
            self._published[channel] += 1
            self._last_stamp_ns = message.stamp_ns  # type: ignore[attr-defined]
        self._given_until_ns = max(self._given_until_ns, until_stamp_ns)
        if self._source.ended and not self._end_sent:
            self._end_sent = True
            end = DriveEnd(
                stamp_ns=self._last_stamp_ns,
                published=self.published,
                skipped_invalid=self._source.skipped_invalid,
            )
            self._bus.publish("end", end, vehicle=self._vehicle_id)
            log.info("the drive is over after %s", self.published)


def run_vehicle(source: VehicleSource, setup: ProcessSetup, *, speed: float | None) -> None:
    """Put `source` on the bus of `setup` until the run ends; blocks, and owns SIGTERM and SIGINT.

    Raises foretwin.contracts.bus.BusUnreachable where no router answers at the start.
    """
    with ZenohBus(setup.bus) as bus:
        process = VehicleProcess(
            source,
            bus=bus,
            run_id=setup.run_id,
            process_id=setup.process_id,
            vehicle_id=setup.vehicle_id,
            speed=speed,
        )

        def leave(_signal: int, _frame: FrameType | None) -> None:
            process.stop()

        signal.signal(signal.SIGTERM, leave)
        process.run()


_Setup = TypeVar("_Setup", bound=ProcessSetup)


def main(
    arguments: list[str], kind: type[_Setup], run: Callable[[_Setup], None], *, program: str
) -> int:
    """Read `--setup FILE`, call `run` with it, and return the exit code: 0 done, 2 user's input."""
    # Ctrl-C reaches the whole process group; the orchestrator ends its children in order.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    if len(arguments) != 2 or arguments[0] != "--setup":
        print(f"usage: python -m {program} --setup FILE", file=sys.stderr)
        return 2
    try:
        setup = read_setup(Path(arguments[1]), kind)
        log_to_file(setup)
        run(setup)
    except (UserError, msgspec.DecodeError, OSError) as problem:
        print(f"{program}: {problem}", file=sys.stderr)
        log.error("%s", problem)
        return 2
    return 0
