"""What the workers of a sweep are started with."""

from __future__ import annotations

from pathlib import Path

from foretwin.contracts.setup import BusSetup, WorkerSetup
from foretwin.orchestrator.sweep.folder import LOG, built_worlds
from foretwin.orchestrator.sweep.spec import FUTURES_PER_JOB, Loaded

_KEPT_WORLDS = 2


def worker_setup(loaded: Loaded, out: Path) -> WorkerSetup:
    """Return the setup of one worker of a sweep into the folder `out`; the bus is still open."""
    vehicles = tuple(loaded.vehicles.values())
    return WorkerSetup(
        run_id="sweep",
        process_id="w0",
        vehicle_id="sweep",
        bus=BusSetup(endpoint=""),
        log_file=str(out / LOG),
        role="futures",
        worlds_dir=str(built_worlds(out)),
        vehicle=vehicles[0],
        swept_vehicles=vehicles,
        control_hz=loaded.spec.control_hz,
        simulations=FUTURES_PER_JOB,
        kept_worlds=_KEPT_WORLDS,
    )
