"""One drive with its faults: started as a user does, watched from outside, looked at afterwards."""

from __future__ import annotations

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

from foretwin.contracts.campaign import role_files
from foretwin.contracts.joining import running_drive
from foretwin.contracts.ports import free_endpoint
from foretwin.contracts.setup import BusSetup
from tests.chaos.disk import SmallDisk, small_disk
from tests.chaos.faults import Case
from tests.chaos.host_clock import CLOCK, HostClock
from tests.chaos.injection import Done, Injection
from tests.chaos.invariants import wrong_with
from tests.chaos.left import Left
from tests.chaos.link import Link, link_for
from tests.chaos.outsiders import Outsider, live_car, remote_planner
from tests.chaos.parts import END_S, TOWN, log_file
from tests.chaos.power_cut import SYNCS, SYNCS_LOG, log_of
from tests.chaos.run_processes import MARK, end_all, marked
from tests.chaos.table import Consequence
from tests.chaos.watcher import Watcher, back_after_s
from tests.contracts.bus_sides import DEADLINE_S
from tests.orchestrator.campaign.campaigns import campaign
from tests.system.foretwin_command import REPOSITORY, Pause, log_lines, run_folder

HERE = Path(__file__).parent
FLAGS = (
    "--view", "none", "--futures", "8", "--least-futures", "4", "--workers", "2", "--rate", "2",
    "--tuning", "report",
)  # fmt: skip
ENDS_WITHIN_S = 150.0
LEAVE_WITHIN_S = 30.0
"""For those whose orchestrator was killed: their grace of 5 s, what they then still write, and a
busy machine."""
RECOVER_WITHIN_S = 120.0


class Outcome(NamedTuple):
    """What became of a case: faults that happened, those that could not, and what is wrong."""

    case: Case
    done: list[Consequence]
    skipped: list[str]
    wrong: list[str]
    code: int
    wall_s: float
    folder: Path
    """Where it lies, if something is wrong."""


def carry_out(
    case: Case, *, keep: bool = False, look_at: Callable[[Left], object] = lambda _: None
) -> Outcome:
    """Drive, let the faults happen, and look at what is left; where all is well nothing stays.

    `look_at` is called with what is left before anything else looks at it.
    """
    base = Path(tempfile.mkdtemp(prefix=f"foretwin-chaos-{case.seed}-{case.number}-"))
    begun_s = time.monotonic()
    with ExitStack() as stack:
        disk = stack.enter_context(small_disk(base / "disk"))
        link = None
        if case.source == "live":
            packets = any(one.what == "loss" for one in case.faults)
            link = stack.enter_context(link_for(case.seed + case.number, packets=packets))
        drive = _ChaosDrive(case, base, disk, link, look_at)
        try:
            drive.go()
        finally:
            drive.close()
        wrong, done = drive.wrong, drive.consequences()
        skipped = (
            [f"{one.what} {one.target}" for one in drive.injection.skipped]
            if drive.injection
            else []
        )
        if wrong or keep:
            shutil.copytree(base / "disk", base / "kept", symlinks=True)
    if wrong or keep:
        lines = [f"{case.name} {case.kind}: exit {drive.code}", *map(str, done), *wrong]
        (base / "report.txt").write_text("\n".join(lines) + "\n", encoding="utf-8")
    else:
        shutil.rmtree(base)
    return Outcome(case, done, skipped, wrong, drive.code, time.monotonic() - begun_s, base)


class _ChaosDrive:
    """The processes of one case; `close` leaves none."""

    def __init__(
        self,
        case: Case,
        base: Path,
        disk: SmallDisk,
        link: Link | None,
        look_at: Callable[[Left], object],
    ) -> None:
        self._case, self._base, self._disk, self._link = case, base, disk, link
        self._look_at = look_at
        self._out, self._syncs = disk.folder / "runs", disk.folder / "syncs"
        self._temporary, self._runtime = base / "tmp", base / "runtime"
        for folder in (self._syncs, self._temporary, self._runtime, base / "cache"):
            folder.mkdir(mode=0o700)
        self._clock = HostClock(base / "clock")
        self._campaign = campaign(base / "campaign") if case.bus == "tls" else None
        self._mark = base.name
        self._outsiders: list[Outsider] = []
        self._back_s: dict[int, float] = {}
        self._lost_s: dict[int, float] = {}
        self.injection: Injection | None = None
        self.wrong: list[str] = []
        self.code = -1
        self._screen = base / "screen"
        with self._screen.open("wb") as screen:
            self._command = subprocess.Popen(
                [sys.executable, "-P", "-m", "foretwin", "drive", *FLAGS, "--out", str(self._out),
                 *self._flags()],
                cwd=base, env=self._environment(), stdin=subprocess.DEVNULL, stdout=screen,
                stderr=subprocess.STDOUT,
            )  # fmt: skip

    def go(self) -> None:
        """Drive to the end, whatever that is."""
        if not self._wait(self._under_way, DEADLINE_S, "the drive to be under way"):
            return
        run = run_folder(self._out)
        if self._command.poll() is not None or run is None:
            return
        begun_ns = time.monotonic_ns()
        injection = self.injection = Injection(
            run, self._mark, self._command, self._disk, self._clock, self._link, self._outsiders,
            self._campaign, self._base,
        )  # fmt: skip
        with Watcher(self._as_viewer(run), run.name) as watcher:
            self._let_happen(injection, begun_ns * 1e-9)
            self._wait(self._has_ended, ENDS_WITHIN_S, "the end of the drive")
            for number, done in enumerate(injection.done):
                back_s = back_after_s(watcher.seen, done.member.name, done.at_ns) if (
                    done.member is not None and done.deadly) else None  # fmt: skip
                if back_s is not None:
                    self._back_s[number] = back_s
        injection.close()
        if self._command.poll() is None:
            return
        self.code = self._command.returncode
        self._wait(lambda: not self._others(), LEAVE_WITHIN_S, "the end of all processes")
        recovered = self._recover(run) if self.code < 0 else None
        left = Left(
            case=self._case, run=run, code=self.code, done=injection.done,
            screen=self._screen.read_text(encoding="utf-8", errors="replace"),
            temporary=(self._temporary, self._runtime), syncs=self._syncs, scratch=self._base,
            recovered=recovered, begun_ns=begun_ns, lost_s=self._lost_s,
        )  # fmt: skip
        self._look_at(left)
        self.wrong += wrong_with(left)

    def consequences(self) -> list[Consequence]:
        """Return what happened and what followed."""
        done = self.injection.done if self.injection is not None else []
        return [
            Consequence(
                what=one.fault.what, kind=one.kind, words=str(one), code=self.code,
                lost_s=self._lost_s.get(number), back_s=self._back_s.get(number),
            )
            for number, one in enumerate(done)
        ]  # fmt: skip

    def close(self) -> None:
        """End what still runs; that is wrong, too."""
        if self.injection is not None:
            self.injection.close()
        for one in self._outsiders:
            one.close()
        self._clock.close()
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
            done: Done | None = injection.begin(fault)
            if done is not None and fault.for_s:
                due.append((fault.at_s + fault.for_s, lambda: injection.end(done)))

        for number, fault in enumerate(self._case.faults):
            due.append((fault.at_s, lambda number=number: begin(number)))
        while due and not self._has_ended():
            due.sort(key=lambda one: one[0])
            if time.monotonic() - begun_s >= due[0][0]:
                due.pop(0)[1]()
            else:
                pause()
        for done in injection.done:
            injection.end(done)

    def _has_ended(self) -> bool:
        if self._command.poll() is not None:
            return True
        for one in self._outsiders:
            one.look()
        return False

    def _under_way(self) -> bool:
        if self._command.poll() is not None:
            self.wrong.append(f"ended before it was under way, with {self._command.returncode}")
            return True
        run = run_folder(self._out)
        if run is None or not (run / "run.json").exists():
            return False
        if not self._outsiders:
            self._start_outsiders(run)
        texts = [line["text"] for line in log_lines(run)]
        return all(any(word in text for text in texts) for word in ("loaded by", "on the map"))

    def _start_outsiders(self, run: Path) -> None:
        if self._link is not None:
            tls = None if self._campaign is None else role_files(self._campaign, "car")
            bus = BusSetup(endpoint=self._over(self._link.endpoint), tls=tls)
            car = live_car(self._base, run.name, bus, prefix=self._link.prefix)
            self._outsiders.append(car)
        if self._case.planner:
            self._outsiders.append(remote_planner(self._base, run))

    def _as_viewer(self, run: Path) -> BusSetup:
        drive = running_drive(run)
        if self._campaign is None:
            return drive.bus("viewer")
        return BusSetup(endpoint=drive.endpoint, tls=role_files(self._campaign, "viewer"))

    def _over(self, endpoint: str) -> str:
        """Return an endpoint of the link as it is spoken to: certificates are for a name."""
        if self._case.bus != "tls":
            return endpoint
        return f"tls/localhost:{endpoint.rsplit(':', 1)[1]}"

    def _flags(self) -> list[str]:
        flags = ["--source", self._case.source]
        if self._case.source == "log":
            flags += ["--log", str(log_file(self._base)), "--map", str(TOWN)]
        if self._case.source == "standin":
            flags += ["--end", f"{END_S:g}"]
        if self._case.planner:
            flags += ["--planner", "remote"]
        if self._case.bus != "socket":
            router = free_endpoint() if self._link is None else self._link.router
            flags += ["--endpoint", self._over(router)]
            secure = ["--secure", str(self._campaign)] if self._campaign else ["--insecure"]
            flags += secure
        return flags

    def _environment(self) -> dict[str, str]:
        paths = os.pathsep.join(map(str, (HERE / "injected", REPOSITORY)))
        return os.environ | {
            MARK: self._mark, SYNCS: str(self._syncs), "PYTHONPATH": paths,
            SYNCS_LOG: str(log_of(self._syncs)), CLOCK: str(self._clock.file),
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
