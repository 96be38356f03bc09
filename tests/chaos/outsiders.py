"""Who takes part in a drive and is none of its processes: a live car, a driving stack.

Nobody of the run starts them again; here somebody does, as for a car's computer or in a second
terminal.
"""

from __future__ import annotations

import os
import subprocess
import sys
import time
from collections.abc import Sequence
from pathlib import Path

from foretwin.contracts.setup import BusSetup, StandinSetup, write_setup
from tests.chaos.parts import END_S, path_file
from tests.system.foretwin_command import REPOSITORY

AGAIN_AFTER_S = 0.5


class Outsider:
    """A process that is started again when it has died, until `close`."""

    def __init__(self, name: str, words: Sequence[str], folder: Path) -> None:
        self.name, self._words, self._folder = name, words, folder
        self._died_s: float | None = None
        self.process = self._start()

    @property
    def pid(self) -> int | None:
        """The process's id while it lives."""
        return self.process.pid if self.process.poll() is None else None

    def look(self) -> None:
        """Start it again, some time after its death."""
        if self.process.poll() is None:
            return
        if self._died_s is None:
            self._died_s = time.monotonic()
        elif time.monotonic() - self._died_s > AGAIN_AFTER_S:
            self._died_s, self.process = None, self._start()

    def close(self) -> None:
        """End it."""
        self.process.kill()
        self.process.wait()

    def _start(self) -> subprocess.Popen[bytes]:
        with (self._folder / f"{self.name}.screen").open("ab") as screen:
            return subprocess.Popen(
                self._words, env=os.environ | {"PYTHONPATH": str(REPOSITORY)},
                stdin=subprocess.DEVNULL, stdout=screen, stderr=screen, cwd=self._folder,
            )  # fmt: skip


def live_car(
    folder: Path, run_id: str, bus: BusSetup, *, prefix: Sequence[str], end_s: float | None = END_S
) -> Outsider:
    """Return a car that drives the town; `prefix` is what its command line begins with."""
    setup = StandinSetup(
        run_id=run_id, process_id="car", vehicle_id="ego", bus=bus,
        log_file=str(folder / "car.jsonl"), path_file=str(path_file(folder)), end_s=end_s,
    )  # fmt: skip
    file = folder / "car.json"
    write_setup(setup, file)
    words = [*prefix, sys.executable, "-P", "-m", "tests.chaos.car", "--setup", str(file)]
    return Outsider("car", words, folder)


def remote_planner(folder: Path, run: Path) -> Outsider:
    """Return a driving stack: the example, as in a second terminal."""
    example = REPOSITORY / "examples" / "remote_planner.py"
    words = [sys.executable, str(example), "--out", str(run.parent)]
    return Outsider("planner", words, folder)
