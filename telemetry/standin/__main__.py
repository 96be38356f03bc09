"""The stand-in car on the live keys: `python -m foretwin.telemetry.standin --setup FILE`."""

from __future__ import annotations

from pathlib import Path

from foretwin.contracts.bus import Bus
from foretwin.contracts.drive import OthersAround
from foretwin.contracts.process import ProcessLife, run_process
from foretwin.contracts.redialled_bus import RedialledBus
from foretwin.contracts.setup import StandinSetup
from foretwin.telemetry.anchored import lot_from_world_message
from foretwin.telemetry.processes.vehicle_process import VehicleProcess
from foretwin.telemetry.standin.parameters import read_parameters
from foretwin.telemetry.standin.path import read_path
from foretwin.telemetry.standin.source import StandinSource


def serve(setup: StandinSetup, bus: Bus, life: ProcessLife) -> None:
    """Drive the path of `setup` until the run is over."""
    file = None if setup.parameters_file is None else Path(setup.parameters_file)
    parameters = read_parameters(file)
    source = StandinSource(
        read_path(Path(setup.path_file), driver=parameters.driver, anchor=setup.anchor),
        parameters,
        vehicle_id=setup.vehicle_id,
        seed=setup.seed,
        end_s=setup.end_s,
        plan_shift_m=setup.plan_shift_m,
        anchor=setup.anchor,
    )
    process = VehicleProcess(
        source,
        bus=bus,
        life=life,
        vehicle_id=setup.vehicle_id,
        speed=setup.speed,
        anchor=setup.anchor,
    )
    if setup.speed is not None:  # in lock step nothing may depend on when a message comes

        def see(around: OthersAround) -> None:
            seen = lot_from_world_message(setup.anchor, around.users)
            source.see(seen.users, stamp_ns=seen.stamp_ns, known_for_s=around.known_for_s)

        process.hear("surroundings", see, vehicle=setup.vehicle_id)
        if not setup.beside:  # what lights show is stamped by the clock of the drive's own car
            process.hear("lights", source.heed, run=setup.run_id)
    process.serve()


if __name__ == "__main__":
    run_process(StandinSetup, serve, join=RedialledBus)
