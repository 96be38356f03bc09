"""A recorded drive, live: `python -m foretwin.telemetry.processes.replay --setup FILE`."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import msgspec

from foretwin.contracts.bus import Bus
from foretwin.contracts.errors import UserError
from foretwin.contracts.process import ProcessLife, run_process
from foretwin.contracts.redialled_bus import RedialledBus
from foretwin.contracts.setup import ReplaySetup
from foretwin.telemetry.logs.log import Log, Sample
from foretwin.telemetry.logs.merge import stamp_ns_of
from foretwin.telemetry.processes.vehicle_process import serve_vehicle


class ReplaySource:
    """The samples of a log between `start_s` and `end_s` from its start; see VehicleSource.

    Stamps stay those of the log, and so does `info.start_stamp_ns`: a drive second is the same
    moment wherever the replay begins.
    """

    def __init__(
        self,
        drive: Log,
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
        self._samples = self._within()
        self._next_sample = next(self._samples, None)
        if self._next_sample is None:
            raise UserError(
                f"{drive.info.source or 'the log'} holds no sample from {start_s} s to "
                f"{'its end' if end_s is None else f'{end_s} s'}"
            )

    def _within(self) -> Iterator[Sample]:
        for sample in self._drive.samples():
            if self._end_ns is not None and stamp_ns_of(sample) > self._end_ns:
                return
            if stamp_ns_of(sample) >= self.first_stamp_ns:
                yield sample

    @property
    def next_stamp_ns(self) -> int:
        """The stamp of the next sample; that of the beginning once there is none."""
        sample = self._next_sample
        return self.first_stamp_ns if sample is None else stamp_ns_of(sample)

    @property
    def ended(self) -> bool:
        """Whether the last sample has been given."""
        return self._next_sample is None

    @property
    def skipped_invalid(self) -> int:
        """What the log has refused so far."""
        return self._drive.skipped.total()

    def advance(self, until_stamp_ns: int) -> Iterator[tuple[str, Any]]:
        """Yield the samples up to and including the stamp, each once."""
        while (sample := self._next_sample) is not None and stamp_ns_of(sample) <= until_stamp_ns:
            self._next_sample = next(self._samples, None)
            yield sample


def serve(setup: ReplaySetup, bus: Bus, life: ProcessLife) -> None:
    """Replay the log of `setup` until the run is over."""
    from foretwin.telemetry.logs import open_log

    source = ReplaySource(
        open_log(Path(setup.log)),
        vehicle_id=setup.vehicle_id,
        start_s=setup.start_s,
        end_s=setup.end_s,
    )
    serve_vehicle(
        source, bus, life, vehicle_id=setup.vehicle_id, speed=setup.speed, anchor=setup.anchor
    )


if __name__ == "__main__":
    run_process(ReplaySetup, serve, join=RedialledBus)
