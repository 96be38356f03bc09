"""`python -m sim_worker --setup FILE`: a worker of the role that its setup names."""

from __future__ import annotations

from contracts.bus import Bus
from contracts.process import ProcessLife, run_process
from contracts.setup import WorkerSetup
from sim_worker.mirror_process import serve_mirror
from sim_worker.worker import serve_futures

ROLES = {"futures": serve_futures, "mirror": serve_mirror}


def serve(setup: WorkerSetup, bus: Bus, life: ProcessLife) -> None:
    """Do the work of the setup's role; raises ValueError naming the known ones."""
    if setup.role not in ROLES:
        raise ValueError(f"unknown role {setup.role!r}; known: {', '.join(sorted(ROLES))}")
    ROLES[setup.role](setup, bus, life)


if __name__ == "__main__":
    run_process(WorkerSetup, serve)
