"""Lets faults happen to a run under way, and takes them back when their time is over."""

from __future__ import annotations

import contextlib
import json
import os
import resource
import signal
import subprocess
import threading
import time
from dataclasses import dataclass, field
from pathlib import Path

from tests.chaos.disk import SmallDisk
from tests.chaos.faults import ENDERS, SERVANTS, Fault
from tests.chaos.link import Link
from tests.chaos.run_processes import Member, members
from tests.chaos.stranger import burst, say_anything
from tests.system.foretwin_command import is_running

_SIGNALS = {
    "kill": signal.SIGKILL, "segv": signal.SIGSEGV, "term": signal.SIGTERM, "hup": signal.SIGHUP,
}  # fmt: skip
_KNOWN = frozenset({*SERVANTS, "vehicle", "orchestrator", "router", "command"})
_HEADROOM_BYTES = 32 * 2**20
_FREE = resource.RLIM_INFINITY


@dataclass
class Done:
    """A fault that happened: to whom, when by the monotonic clock, and in words what came of it."""

    fault: Fault
    member: Member | None
    at_ns: int
    words: str = ""

    @property
    def kind(self) -> str:
        """The kind of process it happened to."""
        return self.member.kind if self.member else self.fault.target

    def __str__(self) -> str:
        who = f" -> {self.member.name} {self.member.pid}" if self.member else ""
        return f"{self.fault}{who}{': ' if self.words else ''}{self.words}"


@dataclass
class Injection:
    """All that faults can reach of one drive."""

    run: Path
    mark: str
    command: subprocess.Popen[bytes]
    disk: SmallDisk
    link: Link | None
    car: subprocess.Popen[bytes] | None
    done: list[Done] = field(default_factory=list)
    skipped: list[str] = field(default_factory=list)
    _threads: list[threading.Thread] = field(default_factory=list)

    def begin(self, fault: Fault) -> Done | None:
        """Let it happen; None where it cannot here."""
        member = self._member(fault)
        done = Done(fault, member, time.monotonic_ns())
        happened = self._begin(fault, member, done)
        (self.done if happened else self.skipped).append(done if happened else str(fault))  # type: ignore[arg-type]
        return done if happened else None

    def end(self, done: Done) -> None:
        """Take it back."""
        match done.fault.what:
            case "stop" | "memory" if done.member is not None and is_running(done.member.pid):
                with contextlib.suppress(ProcessLookupError):
                    if done.fault.what == "stop":
                        os.kill(done.member.pid, signal.SIGCONT)
                    else:
                        resource.prlimit(done.member.pid, resource.RLIMIT_AS, (_FREE, _FREE))
            case "full":
                self.disk.free()
            case "read_only":
                self.disk.open_folders()
            case "cut" | "delay" | "loss" if self.link is not None:
                self.link.mend()

    def close(self) -> None:
        """Wait for who still speaks."""
        for thread in self._threads:
            thread.join()

    def _begin(self, fault: Fault, member: Member | None, done: Done) -> bool:
        match fault.what:
            case "stop":
                return self._signal(member, signal.SIGSTOP)
            case "memory":
                return self._limit(member, fault)
            case "full":
                return self.disk.fill()
            case "read_only":
                return self.disk.close_folders(self.run, *self.run.glob("[pr]*s/"))
            case "cut" | "delay" | "loss":
                return self.link is not None and self.link.befall(fault.what)
            case "clock":
                return self._tell_car(signal.SIGUSR1)
            case "burst" if fault.target == "car":
                return self._tell_car(signal.SIGUSR2)
            case "burst" | "messages":
                return self._speak(fault, done)
            case "power":
                return True
            case what:
                return self._signal(member, _SIGNALS[what])

    def _member(self, fault: Fault) -> Member | None:
        """Return who it happens to: of the kind that was drawn, else any that is started again."""
        if fault.what not in (*ENDERS, "stop", "memory"):
            return None
        there = members(self.run, self.mark, self.command.pid)
        wanted = fault.target
        if wanted == "command" and not any(one.name == wanted for one in there):
            wanted = "orchestrator"
        found = [one for one in there if one.kind == wanted]
        if wanted == "other":
            found = [one for one in there if one.kind not in _KNOWN or one.kind == wanted]
        found = found or [one for one in there if one.kind in SERVANTS]
        return found[int(1000 * fault.at_s) % len(found)] if found else None

    def _signal(self, member: Member | None, number: signal.Signals) -> bool:
        if member is None:
            return False
        with contextlib.suppress(ProcessLookupError):
            os.kill(member.pid, number)
            return True
        return False

    def _limit(self, member: Member | None, fault: Fault) -> bool:
        """Leave a process no more memory than it has, and a little."""
        if member is None:
            return False
        with contextlib.suppress(OSError, ValueError):
            has = (
                int(Path(f"/proc/{member.pid}/statm").read_text().split()[0])
                * resource.getpagesize()
            )
            most = has + round(fault.strength * _HEADROOM_BYTES)
            resource.prlimit(member.pid, resource.RLIMIT_AS, (most, _FREE))
            return True
        return False

    def _tell_car(self, number: signal.Signals) -> bool:
        if self.car is None or self.car.poll() is not None:
            return False
        self.car.send_signal(number)
        return True

    def _speak(self, fault: Fault, done: Done) -> bool:
        try:
            record = json.loads((self.run / "run.json").read_text(encoding="utf-8"))
        except (OSError, ValueError):
            return False
        endpoint, run_id = record.get("endpoint"), record["run_id"]
        if endpoint is None:
            return False

        def speak() -> None:
            try:
                done.words = (
                    burst(endpoint, run_id, fault.for_s)
                    if fault.what == "burst"
                    else say_anything(endpoint, run_id, fault.strength)
                )
            except Exception as error:
                done.words = f"{type(error).__name__}: {error}"[:120]

        self._threads.append(threading.Thread(target=speak, daemon=True))
        self._threads[-1].start()
        return True
