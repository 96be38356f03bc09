"""`python -m foretwin.sim_worker.far --setup FILE`: a worker on another machine."""

from __future__ import annotations

from foretwin.contracts.process import run_process
from foretwin.contracts.redialled_bus import RedialledBus
from foretwin.contracts.setup import FarWorkerSetup
from foretwin.sim_worker.far.worker import serve_far

if __name__ == "__main__":
    run_process(FarWorkerSetup, serve_far, join=RedialledBus)
