"""`python -m foretwin.sim_worker.virtual_traffic --setup FILE` (`TrafficSetup`)."""

from __future__ import annotations

from foretwin.contracts.process import run_process
from foretwin.contracts.setup import TrafficSetup
from foretwin.sim_worker.virtual_traffic.process import serve_traffic

if __name__ == "__main__":
    run_process(TrafficSetup, serve_traffic)
