"""A recorded drive, live: `python -m foretwin.telemetry.processes.replay --setup FILE`."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, Protocol

import msgspec

from foretwin.contracts.bus import Bus
from foretwin.contracts.drive import GnssFix, VehicleInfo
from foretwin.contracts.errors import UserError
from foretwin.contracts.process import ProcessLife, run_process
from foretwin.contracts.setup import ReplaySetup
from foretwin.telemetry.processes.vehicle_process import serve_vehicle


class ReplayableLog(Protocol):
    """What replay needs of a log; `foretwin.telemetry.logs.open_log` gives it."""

    @property
    def info(self) -> VehicleInfo:
        """What the log says of its vehicle."""

    @property
    def skipped(self) -> Any:
        """What the reader refused: a count, or counts by reason."""

    def samples(self) -> Iterator[tuple[str, Any]]:
        """Yield (channel, message) in stamp order."""


class ReplaySource:
    """The samples of a log between `start_s` and `end_s` from its start; see VehicleSource.

    Stamps stay those of the log, and so does `info.start_stamp_ns`: a drive second is the same
    moment wherever the replay begins.
    """

    def __init__(
        self,
        drive: ReplayableLog,
        *,
        vehicle_id: str,
        start_s: float = 0.0,
        end_s: float | None = None,
    ) -> None:
        """Raises UserError for times out of order or a start after the log's last sample."""
        if start_s < 0.0 or (end_s is not None and end_s <= start_s):
            raise UserError(f"replay from {start_s} s to {end_s} s: start must be before the end")
        self._drive = drive
        log_start_ns = drive.info.start_stamp_ns
        self.first_stamp_ns = log_start_ns + round(start_s * 1e9)
        end_ns = drive.info.end_stamp_ns
        if end_s is not None:
            wanted_ns = log_start_ns + round(end_s * 1e9)
            end_ns = wanted_ns if end_ns is None else min(end_ns, wanted_ns)
        self._end_ns = end_ns
        self.info = msgspec.structs.replace(drive.info, vehicle_id=vehicle_id, end_stamp_ns=end_ns)
        self._refused = 0
        self._next_sample: tuple[str, Any] | None = None
        self._samples = self._believable()
        self._next_sample = next(self._samples, None)
        if self._next_sample is None:
            raise UserError(
                f"{drive.info.source or 'the log'} holds no sample from {start_s} s to "
                f"{'its end' if end_s is None else f'{end_s} s'}"
            )

    def _believable(self) -> Iterator[tuple[str, Any]]:
        last_ns: int | None = None
        for channel, message in self._drive.samples():
            if message.stamp_ns < self.first_stamp_ns:
                continue
            if self._end_ns is not None and message.stamp_ns > self._end_ns:
                return
            backwards = last_ns is not None and message.stamp_ns < last_ns
            if backwards or (isinstance(message, GnssFix) and not _placed(message)):
                self._refused += 1
                continue
            last_ns = message.stamp_ns
            yield channel, message

    @property
    def ended(self) -> bool:
        """Whether the last sample has been given."""
        return self._next_sample is None

    @property
    def skipped_invalid(self) -> int:
        """What the reader and the replay have refused so far."""
        skipped = self._drive.skipped
        count = sum(skipped.values()) if isinstance(skipped, Mapping) else int(skipped)
        return count + self._refused

    def advance(self, until_stamp_ns: int) -> Iterator[tuple[str, Any]]:
        """Yield the samples up to and including the stamp, each once."""
        while self._next_sample is not None and self._next_sample[1].stamp_ns <= until_stamp_ns:
            sample = self._next_sample
            self._next_sample = next(self._samples, None)
            yield sample


def _placed(fix: GnssFix) -> bool:
    lat, lon = fix.position.lat_deg, fix.position.lon_deg
    return math.isfinite(lat) and math.isfinite(lon) and (lat, lon) != (0.0, 0.0)


def serve(setup: ReplaySetup, bus: Bus, life: ProcessLife) -> None:
    """Replay the log of `setup` until the run is over."""
    from foretwin.telemetry.logs import open_log

    source = ReplaySource(
        open_log(Path(setup.log)),
        vehicle_id=setup.vehicle_id,
        start_s=setup.start_s,
        end_s=setup.end_s,
    )
    serve_vehicle(source, bus, life, vehicle_id=setup.vehicle_id, speed=setup.speed)


if __name__ == "__main__":
    run_process(ReplaySetup, serve)
