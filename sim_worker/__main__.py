"""`python -m foretwin.sim_worker --setup FILE`: a worker of the role that its setup names."""

from __future__ import annotations

import os
from importlib import import_module

from foretwin.contracts.bus import Bus
from foretwin.contracts.process import ProcessLife, run_process
from foretwin.contracts.setup import WorkerSetup

ROLES = {
    "futures": ("foretwin.sim_worker.worker", "serve_futures"),
    "mirror": ("foretwin.sim_worker.mirror.process", "serve_mirror"),
}
"""Module and function of each role: the mirror starts without what plays futures."""


LAST = 19
"""Niceness of who gives way: all else that wants a processor comes first."""


def serve(setup: WorkerSetup, bus: Bus, life: ProcessLife) -> None:
    """Do the work of the setup's role; raises ValueError naming the known ones."""
    if setup.gives_way:
        os.nice(LAST)
    if setup.role not in ROLES:
        raise ValueError(f"unknown role {setup.role!r}; known: {', '.join(sorted(ROLES))}")
    module, name = ROLES[setup.role]
    getattr(import_module(module), name)(setup, bus, life)


if __name__ == "__main__":
    run_process(WorkerSetup, serve)
