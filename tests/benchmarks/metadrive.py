"""Futures among 20 road users, against MetaDrive 0.3.0.1 with as many.

MetaDrive needs numpy < 2 and panda3d-simplepbr 0.10, so it has an environment of its own, which
METADRIVE_VENV names.
"""

from __future__ import annotations

import os
import subprocess
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

from foretwin.sim_worker.batch.batch_simulation import BatchSimulation
from foretwin.sim_worker.vehicle.parameters import load_vehicle
from tests.benchmarks import busy_junction, scenes
from tests.benchmarks.closed_loop import SECONDS, job_runner
from tests.benchmarks.measuring import Measurement, UnavailableError, cpu_seconds

VARIABLE = "METADRIVE_VENV"
REPEATS = 6
PASS_S = 4.0
DRIVER = Path(__file__).with_name("metadrive_drive.py")


def measure() -> Measurement:
    """Return simulated seconds per CPU second of whole jobs of the full scene."""
    stage = BatchSimulation(
        busy_junction.world(), load_vehicle(), nsim=scenes.FUTURES, control_hz=scenes.CONTROL_HZ
    )
    with _metadrive() as theirs:
        run = job_runner(stage, busy_junction.busy_job())
        job_s, best = float("inf"), 0.0
        for _ in range(REPEATS):
            job_s = min(job_s, cpu_seconds(run))
            best = max(best, theirs())
    return Measurement(SECONDS / job_s, "simulated s per CPU s", best)


@contextmanager
def _metadrive() -> Iterator[Callable[[], float]]:
    """Yield what lets MetaDrive drive on, and returns its simulated seconds per CPU second."""
    folder = os.environ.get(VARIABLE)
    python = Path(folder or "") / "bin" / "python"
    if not folder or not python.is_file():
        raise UnavailableError(f"{VARIABLE} names no environment with MetaDrive 0.3.0.1")
    command = [
        str(python),
        "-I",
        "-W",
        "ignore",
        str(DRIVER),
        str(busy_junction.ROAD_USERS),
        str(PASS_S),
    ]
    # -I: else the folder of the driver, with this module in it, would come before MetaDrive.
    with subprocess.Popen(
        command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True
    ) as process:
        asked, said = process.stdin, process.stdout
        assert asked is not None
        assert said is not None
        try:
            if not any(line.strip() == "ready" for line in said):
                raise UnavailableError(
                    "MetaDrive does not start: run tests/benchmarks/"
                    "metadrive_drive.py in its environment to see why"
                )

            def drive_on() -> float:
                asked.write("\n")
                asked.flush()
                return float(said.readline())

            yield drive_on
        finally:
            process.kill()
