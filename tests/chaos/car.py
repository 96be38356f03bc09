"""A live car whose clock jumps and that says ten times as much when it is told to:
`python -m tests.chaos.car --setup FILE` (`StandinSetup`).

SIGUSR1 sets its clock, by how much its seed says; SIGUSR2 begins a burst of two seconds. One that
is started again has driven on meanwhile.
"""

from __future__ import annotations

import logging
import random
import signal
import time
from collections.abc import Iterator
from pathlib import Path

import msgspec

from foretwin.contracts.bus import Bus
from foretwin.contracts.process import ProcessLife, run_process
from foretwin.contracts.redialled_bus import RedialledBus
from foretwin.contracts.setup import StandinSetup
from foretwin.telemetry.processes.vehicle_process import VehicleSource, serve_vehicle
from foretwin.telemetry.standin.parameters import read_parameters
from foretwin.telemetry.standin.path import read_path
from foretwin.telemetry.standin.source import StandinSource

STEPS_S = (0.2, -0.2, 2.0, -2.0, 30.0, -30.0, 3600.0)
BURST_NS, TIMES = 2_000_000_000, 10
_APART_NS = 400_000
"""Between the copies of a burst: all lie before the next sample of any channel."""


class ErraticSource:
    """A source as it is, but for clock and bursts; see VehicleSource."""

    def __init__(self, source: VehicleSource, *, seed: int) -> None:
        self._source, self._chance = source, random.Random(seed)
        self.info, self.first_stamp_ns = source.info, source.first_stamp_ns
        self._offset_ns = 0
        self._burst_until_ns = 0
        self._now_ns = source.first_stamp_ns

    def drive_on(self, for_ns: int) -> None:
        """Let nothing come of what it drives first."""
        self.first_stamp_ns += for_ns
        for _ in self._source.advance(self.first_stamp_ns - 1):
            pass

    @property
    def next_stamp_ns(self) -> int:
        """When the next sample is due."""
        return self._source.next_stamp_ns

    @property
    def ended(self) -> bool:
        """Whether the last sample has been given."""
        return self._source.ended

    @property
    def skipped_invalid(self) -> int:
        """How many samples were refused so far."""
        return self._source.skipped_invalid

    def set_clock(self) -> None:
        """Let the stamps from now on be others."""
        self._offset_ns += round(1e9 * self._chance.choice(STEPS_S))
        logging.getLogger("car").info("the clock is %d ns off", self._offset_ns)

    def begin_burst(self) -> None:
        """Let every sample of the next seconds come ten times."""
        self._burst_until_ns = self._now_ns + BURST_NS

    def advance(self, until_stamp_ns: int) -> Iterator[tuple[str, msgspec.Struct]]:
        """Yield what the source does, by this clock and as often as it shall come."""
        for channel, message in self._source.advance(until_stamp_ns):
            self._now_ns = message.stamp_ns  # type: ignore[attr-defined]
            times = TIMES if self._now_ns < self._burst_until_ns else 1
            for copy in range(times):
                stamp_ns = self._now_ns + self._offset_ns + copy * _APART_NS
                yield channel, msgspec.structs.replace(message, stamp_ns=stamp_ns)


def serve(setup: StandinSetup, bus: Bus, life: ProcessLife) -> None:
    """Drive the path of `setup` until the run is over."""
    parameters = read_parameters(None)
    source = ErraticSource(
        StandinSource(
            read_path(Path(setup.path_file), driver=parameters.driver),
            parameters,
            vehicle_id=setup.vehicle_id,
            seed=setup.seed,
            end_s=setup.end_s,
        ),
        seed=setup.seed,
    )
    begun = Path(setup.path_file).with_name("car.begun")
    if begun.exists():
        source.drive_on(time.monotonic_ns() - int(begun.read_text()))
    else:
        begun.write_text(str(time.monotonic_ns()))
    signal.signal(signal.SIGUSR1, lambda *_: source.set_clock())
    signal.signal(signal.SIGUSR2, lambda *_: source.begin_burst())
    serve_vehicle(source, bus, life, vehicle_id=setup.vehicle_id, speed=setup.speed)


if __name__ == "__main__":
    run_process(StandinSetup, serve, join=RedialledBus)
