"""A recorded drive beside the car's, read ahead by a thread: no file holds up a drive."""

from __future__ import annotations

import threading
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

from foretwin.contracts.anchor import Anchor
from foretwin.contracts.drive import VehicleInfo, VehicleState
from foretwin.contracts.errors import one_line
from foretwin.contracts.mailbox import Mailbox
from foretwin.contracts.roles import OtherVehicle
from foretwin.contracts.vehicle import VehicleParameters
from foretwin.orchestrator.instructions import Notice
from foretwin.orchestrator.other_vehicles.measured import OtherVehicleSource, OtherVehicleStates
from foretwin.telemetry.anchored import world_from_lot_info, world_from_lot_message
from foretwin.telemetry.estimator.estimator import estimator_of
from foretwin.telemetry.logs import open_log
from foretwin.telemetry.processes.replay import ReplaySource

AHEAD_SAMPLES = 4096
"""So far at most is read ahead: some twenty seconds of a car that sends everything."""
STUCK_AFTER_S = 120.0
BEHIND_NS = 1_000_000_000
_CLOSING_S = 1.0
_FOREVER_NS = 2**63 - 1


class _Read(NamedTuple):
    """A sample that was read: its stamp in the car's time, and the state that it gave."""

    stamp_ns: int
    heard: OtherVehicle | None


class _Over(NamedTuple):
    """The log's end, or what it ended with."""

    failed: str | None


class RecordedVehicle(OtherVehicleSource):
    """A recorded drive, given as far as the car's own time has come.

    Two logs on UTC keep their stamps; otherwise both begin together. `offset_s` says how much of
    this log has passed as the car's drive begins. With `waits` (lock step) the drive waits for what
    is to come, so that results do not depend on the disk; else it takes what has been read, and a
    log that is read too slowly gives its states late. A log that breaks off is told of, and the
    vehicle is gone then. It drove on its `lot`, where that is given.
    """

    def __init__(
        self,
        file: Path,
        vehicle_id: str,
        vehicle: VehicleParameters,
        *,
        own: VehicleInfo,
        offset_s: float | None,
        waits: bool,
        lot: Anchor | None = None,
        tell: Callable[[Notice], None],
    ) -> None:
        super().__init__()
        self._file, self._id, self._vehicle = file, vehicle_id, vehicle
        self._own, self._offset_s = own, offset_s
        self._waits, self._tell, self._lot = waits, tell, lot
        self._read: Mailbox = Mailbox(AHEAD_SAMPLES, when_full="block")
        self._next: _Read | None = None
        self._newest_ns = own.start_stamp_ns
        self._over = self._delay_reported = False
        self._stop = threading.Event()
        self._thread = threading.Thread(
            target=self._read_all, name=f"log of {vehicle_id}", daemon=True
        )
        self._thread.start()

    def states_until(self, own: VehicleState) -> list[OtherVehicle]:
        """Return the states up to the car's own; raises TimeoutError where a reader hangs that
        must be waited for."""
        heard = []
        while not self._over:
            item: Any = self._next or self._read.take(STUCK_AFTER_S if self._waits else 0.0)
            self._next = None
            if item is None:
                self._lacks(own)
                break
            if isinstance(item, _Over):
                self._end(item)
            elif item.stamp_ns > own.stamp_ns:
                self._next = item
                break
            else:
                self._newest_ns = item.stamp_ns
                if item.heard is not None:
                    heard.append(item.heard)
        return heard

    def close(self) -> None:
        """Stop reading; idempotent. A thread that hangs in its file ends with the process."""
        self._stop.set()
        self._read.close()
        self._thread.join(_CLOSING_S)

    def _lacks(self, own: VehicleState) -> None:
        if self._waits:
            raise TimeoutError(f"waited {STUCK_AFTER_S:.0f} s for {self._file} of {self._id}")
        if not self._delay_reported and own.stamp_ns - self._newest_ns > BEHIND_NS:
            self._delay_reported = True
            text = f"{self._file} of {self._id} is read too slowly: its states come late"
            self._tell(Notice("warning", text))

    def _end(self, over: _Over) -> None:
        self._over = True
        if over.failed is not None:
            text = f"{self._file} of {self._id} cannot be read on: {over.failed}"
            self._tell(Notice("warning", text))

    def _read_all(self) -> None:
        """Read in a thread of its own; files and estimator belong to it alone."""
        failed = None
        try:
            source = ReplaySource(open_log(self._file), vehicle_id=self._id)
            later_ns = self._later_ns(source.info)
            info = world_from_lot_info(self._lot, source.info)
            measured = OtherVehicleStates(self._id, estimator_of(info, self._vehicle))
            for channel, on_lot in source.advance(_FOREVER_NS):
                if self._stop.is_set():
                    return
                message = world_from_lot_message(self._lot, on_lot)
                heard = measured.take(channel, message, later_ns=later_ns)
                self._read.put(_Read(message.stamp_ns + later_ns, heard))
        except Exception as error:  # whatever a reader raises over a broken file
            failed = one_line(error)
        self._read.put(_Over(failed))

    def _later_ns(self, info: VehicleInfo) -> int:
        """Return what is added to the log's stamps for the car's time."""
        if self._offset_s is None and info.time_base == self._own.time_base == "utc":
            return 0
        log_ns = info.start_stamp_ns + round((self._offset_s or 0.0) * 1e9)
        return self._own.start_stamp_ns - log_ns
