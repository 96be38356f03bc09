"""One drive with its faults: started as a user does, watched from outside, looked at afterwards."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path
from typing import NamedTuple

from foretwin.contracts.setup import BusSetup, StandinSetup, write_setup
from foretwin.orchestrator.config import DriveConfig
from foretwin.orchestrator.drive.plan import read_inputs
from tests.chaos.disk import SmallDisk, small_disk
from tests.chaos.faults import DRIVING_S, Case
from tests.chaos.injection import Done, Injection
from tests.chaos.invariants import Left, wrong_with
from tests.chaos.link import Link, link_for
from tests.chaos.power_cut import SYNCS, SYNCS_LOG, log_of
from tests.chaos.run_processes import MARK, end_all, marked
from tests.contracts.bus_sides import DEADLINE_S
from tests.system.foretwin_command import REPOSITORY, Pause, log_lines, run_folder

HERE = Path(__file__).parent
FLAGS = (
    "--view", "none", "--futures", "8", "--least-futures", "4", "--workers", "2", "--rate", "2",
    "--tuning", "report",
)  # fmt: skip
ENDS_WITHIN_S = 240.0
LEAVE_WITHIN_S = 30.0
"""For those whose orchestrator was killed: their grace of 5 s, what they then still write, and a
busy machine."""
RECOVER_WITHIN_S = 120.0


class Outcome(NamedTuple):
    """What became of a case: faults that happened, those that could not, and what is wrong."""

    case: Case
    done: list[Done]
    skipped: list[str]
    wrong: list[str]
    code: int
    wall_s: float
    folder: Path
    """Where it lies, if something is wrong."""


def carry_out(case: Case, *, keep: bool = False) -> Outcome:
    """Drive, let the faults happen, and look at what is left; where all is well nothing stays."""
    base = Path(tempfile.mkdtemp(prefix=f"foretwin-chaos-{case.seed}-{case.number}-"))
    begun_s = time.monotonic()
    with ExitStack() as stack:
        disk = stack.enter_context(small_disk(base / "disk"))
        link = None
        if case.linked:
            packets = any(one.what == "loss" for one in case.faults)
            link = stack.enter_context(link_for(case.seed + case.number, packets=packets))
        drive = _ChaosDrive(case, base, disk, link)
        try:
            drive.go()
        finally:
            drive.close()
        wrong = drive.wrong
        done = drive.injection.done if drive.injection else []
        skipped = drive.injection.skipped if drive.injection else []
        if wrong or keep:
            shutil.copytree(base / "disk", base / "kept", symlinks=True)
    if wrong or keep:
        lines = [f"{case.name}: exit {drive.code}", *map(str, done), *wrong]
        (base / "report.txt").write_text("\n".join(lines) + "\n", encoding="utf-8")
    else:
        shutil.rmtree(base)
    return Outcome(case, done, skipped, wrong, drive.code, time.monotonic() - begun_s, base)


class _ChaosDrive:
    """The processes of one case; `close` leaves none."""

    def __init__(self, case: Case, base: Path, disk: SmallDisk, link: Link | None) -> None:
        self._case, self._base, self._disk, self._link = case, base, disk, link
        self._out, self._syncs = disk.folder / "runs", disk.folder / "syncs"
        self._temporary, self._runtime = base / "tmp", base / "runtime"
        for folder in (self._syncs, self._temporary, self._runtime, base / "cache"):
            folder.mkdir(mode=0o700)
        self._mark = base.name
        self._car: subprocess.Popen[bytes] | None = None
        self.injection: Injection | None = None
        self.wrong: list[str] = []
        self.code = -1
        self._screen = base / "screen"
        with self._screen.open("wb") as screen:
            self._command = subprocess.Popen(
                [sys.executable, "-P", "-m", "foretwin", "drive", *FLAGS, "--out", str(self._out),
                 *self._source()],
                cwd=base, env=self._environment(), stdin=subprocess.DEVNULL, stdout=screen,
                stderr=subprocess.STDOUT,
            )  # fmt: skip

    def go(self) -> None:
        """Drive to the end, whatever that is."""
        if not self._wait(self._under_way, DEADLINE_S, "the drive to be under way"):
            return
        run = run_folder(self._out)
        assert run is not None
        begun_ns = time.monotonic_ns()
        self.injection = Injection(
            run, self._mark, self._command, self._disk, self._link, self._car
        )
        self._let_happen(self.injection, begun_ns * 1e-9)
        self._wait(lambda: self._command.poll() is not None, ENDS_WITHIN_S, "the end of the drive")
        self.injection.close()
        if self._command.poll() is None:
            return
        self.code = self._command.returncode
        self._wait(lambda: not self._others(), LEAVE_WITHIN_S, "the end of all processes")
        recovered = self._recover(run) if self.code < 0 else None
        left = Left(
            case=self._case, run=run, code=self.code, done=self.injection.done,
            screen=self._screen.read_text(encoding="utf-8", errors="replace"),
            temporary=(self._temporary, self._runtime), syncs=self._syncs, scratch=self._base,
            recovered=recovered, begun_ns=begun_ns,
        )  # fmt: skip
        self.wrong += wrong_with(left)

    def close(self) -> None:
        """End what still runs; that is wrong, too."""
        if self.injection is not None:
            for done in self.injection.done:
                self.injection.end(done)
        if self._car is not None:
            self._car.kill()
            self._car.wait()
        left = end_all(self._mark)
        self._command.wait()
        if left:
            self.wrong += [f"still runs: {one}" for one in left]

    def _let_happen(self, injection: Injection, begun_s: float) -> None:
        """Begin and end faults at their times, as long as the drive goes on."""
        due: list[tuple[float, Callable[[], object]]] = []
        pause = Pause()

        def begin(number: int) -> None:
            fault = self._case.faults[number]
            done = injection.begin(fault)
            if done is not None and fault.for_s:
                due.append((fault.at_s + fault.for_s, lambda: injection.end(done)))

        for number, fault in enumerate(self._case.faults):
            due.append((fault.at_s, lambda number=number: begin(number)))
        while due and self._command.poll() is None:
            due.sort(key=lambda one: one[0])
            if time.monotonic() - begun_s >= due[0][0]:
                due.pop(0)[1]()
            else:
                pause()
        for done in injection.done:
            injection.end(done)

    def _under_way(self) -> bool:
        if self._command.poll() is not None:
            self.wrong.append(f"ended before it was under way, with {self._command.returncode}")
            return True
        run = run_folder(self._out)
        if run is None or not (run / "run.json").exists():
            return False
        if self._link is not None and self._car is None:
            self._car = self._start_car(run)
        texts = [line["text"] for line in log_lines(run)]
        return all(any(word in text for text in texts) for word in ("loaded by", "on the map"))

    def _start_car(self, run: Path) -> subprocess.Popen[bytes]:
        assert self._link is not None
        setup = StandinSetup(
            run_id=run.name, process_id="car", vehicle_id="ego",
            bus=BusSetup(endpoint=self._link.endpoint), log_file=str(self._base / "car.jsonl"),
            path_file=str(_standin_path(self._base)), end_s=DRIVING_S + 4.0,
            seed=self._case.number,
        )  # fmt: skip
        file = self._base / "car.json"
        write_setup(setup, file)
        return subprocess.Popen(
            [*self._link.prefix, sys.executable, "-P", "-m", "tests.chaos.car", "--setup",
             str(file)],
            env=os.environ | {"PYTHONPATH": str(REPOSITORY)}, stdin=subprocess.DEVNULL,
            cwd=self._base,
        )  # fmt: skip

    def _source(self) -> tuple[str, ...]:
        if self._link is None:
            return ("--source", "standin", "--end", f"{DRIVING_S + 4.0:g}")
        config = self._base / "live.toml"
        config.write_text(f'endpoint = "{self._link.router}"\ninsecure = true\n', encoding="utf-8")
        return ("--source", "live", "--config", str(config))

    def _environment(self) -> dict[str, str]:
        paths = os.pathsep.join(map(str, (HERE / "injected", REPOSITORY)))
        return os.environ | {
            MARK: self._mark, SYNCS: str(self._syncs), "PYTHONPATH": paths,
            SYNCS_LOG: str(log_of(self._syncs)),
            "XDG_CACHE_HOME": str(self._base / "cache"), "TMPDIR": str(self._temporary),
            "XDG_RUNTIME_DIR": str(self._runtime),
        }  # fmt: skip

    def _others(self) -> list[int]:
        return [pid for pid in marked(self._mark) if pid != self._command.pid]

    def _recover(self, run: Path) -> tuple[int, str]:
        """Recover the run as a user does; returns exit code and screen."""
        done = subprocess.run(
            [sys.executable, "-P", "-m", "foretwin", "recover", str(run)],
            env=self._environment(), capture_output=True, text=True, cwd=self._base,
            timeout=RECOVER_WITHIN_S, check=False,
        )  # fmt: skip
        return done.returncode, done.stdout + done.stderr

    def _wait(self, condition: Callable[[], bool], within_s: float, what: str) -> bool:
        begun_s, pause = time.monotonic(), Pause()
        while not condition():
            if time.monotonic() - begun_s > within_s:
                self.wrong.append(f"hangs: waited {within_s:g} s for {what}")
                return False
            pause()
        return True


def _standin_path(base: Path) -> Path:
    """Write what the car drives: the route of the drawn town."""
    standin = read_inputs(DriveConfig(source="standin")).standin
    assert standin is not None
    file = base / "path.json"
    file.write_text(json.dumps(standin.as_json()), encoding="utf-8")
    return file
