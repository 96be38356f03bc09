"""The stand-in car with a spell in which every sample comes ten times:
`python -m tests.system.busy_car --setup FILE` (`StandinSetup`).
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path

import msgspec

from foretwin.contracts.bus import Bus
from foretwin.contracts.process import ProcessLife, run_process
from foretwin.contracts.setup import StandinSetup
from foretwin.telemetry.processes.vehicle_process import serve_vehicle
from foretwin.telemetry.standin.parameters import read_parameters
from foretwin.telemetry.standin.path import read_path
from foretwin.telemetry.standin.source import StandinSource
from tests.chaos.car import ErraticSource

SPELL_S = "FORETWIN_SPELL_S"
"""The environment's name for the spell's first and last second of the drive: `600,900`."""


class BusySource(ErraticSource):
    """A source in a burst from `from_s` to `to_s`; see VehicleSource."""

    def __init__(self, source: StandinSource, *, from_s: float, to_s: float) -> None:
        super().__init__(source, seed=0)
        first_ns = source.first_stamp_ns
        self._spell_ns = first_ns + round(from_s * 1e9), first_ns + round(to_s * 1e9)

    def advance(self, until_stamp_ns: int) -> Iterator[tuple[str, msgspec.Struct]]:
        """Yield what the source does, as often as it shall come."""
        if self._spell_ns[0] <= until_stamp_ns < self._spell_ns[1]:
            self.begin_burst()
        return super().advance(until_stamp_ns)


def serve(setup: StandinSetup, bus: Bus, life: ProcessLife) -> None:
    """Drive the path of `setup` until the run is over."""
    from_s, to_s = map(float, os.environ[SPELL_S].split(","))
    parameters = read_parameters(None)
    path = read_path(Path(setup.path_file), driver=parameters.driver)
    source = StandinSource(
        path, parameters, vehicle_id=setup.vehicle_id, seed=setup.seed, end_s=setup.end_s
    )
    busy = BusySource(source, from_s=from_s, to_s=to_s)
    serve_vehicle(busy, bus, life, vehicle_id=setup.vehicle_id, speed=setup.speed)


if __name__ == "__main__":
    run_process(StandinSetup, serve)
