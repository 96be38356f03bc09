"""What the workers of a sweep are started with."""

from __future__ import annotations

from pathlib import Path

from foretwin.contracts.setup import BusSetup, WorkerSetup
from foretwin.orchestrator.sweep.folder import LOG, built_worlds
from foretwin.orchestrator.sweep.spec import Loaded
from foretwin.orchestrator.sweep.stacks import FUTURES_PER_JOB, longest_wait_s

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
        stacks=tuple(
            (name, loaded.spec.remote[name].setup(says)) for name, says in loaded.stacks.items()
        ),
    )


def task_timeout_s(loaded: Loaded) -> float:
    """Return how long a worker may be at a task: what is waited for driving stacks comes on top,
    since these have a limit of their own."""
    spec, horizons = loaded.spec, [scenario.horizon_s for scenario in loaded.scenarios]
    stacks = {name: spec.remote[name] for name in loaded.stacks}
    longest = max(horizons) if spec.horizon_s is None else spec.horizon_s
    return spec.job_timeout_s + longest_wait_s(stacks, horizon_s=longest)
