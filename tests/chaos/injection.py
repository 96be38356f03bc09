"""Lets faults happen to a run under way, and takes them back when their time is over."""

from __future__ import annotations

import contextlib
import os
import random
import resource
import signal
import subprocess
import threading
import time
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

from foretwin.contracts.errors import UserError
from foretwin.contracts.joining import running_drive
from tests.chaos.disk import SmallDisk
from tests.chaos.faults import ENDERS, OUTSIDE, Fault
from tests.chaos.host_clock import HostClock
from tests.chaos.link import Link
from tests.chaos.outsiders import Outsider
from tests.chaos.run_processes import Member, marked, members
from tests.chaos.stranger import burst, guise, say_anything
from tests.system.foretwin_command import is_running

_SIGNALS = {
    "kill": signal.SIGKILL, "segv": signal.SIGSEGV, "term": signal.SIGTERM, "hup": signal.SIGHUP,
}  # fmt: skip
_HEADROOM_BYTES = 32 * 2**20
_FREE = resource.RLIM_INFINITY


@dataclass
class Done:
    """A fault that happened: to whom, when by the monotonic clock, and in words what came of it."""

    fault: Fault
    member: Member | None
    at_ns: int
    words: str = ""
    over: bool = False
    """Whether it was taken back."""
    deadly: bool = False
    """Whether the process it happened to did not live on."""

    @property
    def kind(self) -> str:
        """The kind of process it happened to, else of thing."""
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
    clock: HostClock
    link: Link | None
    outsiders: Sequence[Outsider]
    campaign: Path | None
    scratch: Path
    done: list[Done] = field(default_factory=list)
    skipped: list[Fault] = field(default_factory=list)
    _threads: list[threading.Thread] = field(default_factory=list)

    def begin(self, fault: Fault) -> Done | None:
        """Let it happen; None where it cannot here."""
        member = self._member(fault)
        done = Done(fault, member, time.monotonic_ns())
        if not self._begin(fault, member, done):
            self.skipped.append(fault)
            return None
        self.done.append(done)
        return done

    def end(self, done: Done) -> None:
        """Take it back, once."""
        if done.over:
            return
        done.over = True
        match done.fault.what:
            case "stop" | "memory" if done.member is not None:
                done.deadly = not is_running(done.member.pid)
                with contextlib.suppress(ProcessLookupError):
                    if done.fault.what == "stop":
                        os.kill(done.member.pid, signal.SIGCONT)
                    else:
                        self._lift_limits()
            case "full":
                self.disk.free()
            case "read_only":
                self.disk.open_folders()
            case "cut" | "delay" | "loss" if self.link is not None:
                self.link.mend()

    def close(self) -> None:
        """Take back what lasts, and wait for who still speaks."""
        for done in self.done:
            self.end(done)
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
            case "host_clock":
                done.words = self.clock.set(fault.strength)
                return True
            case "burst" if fault.target == "car":
                return self._tell_car(signal.SIGUSR2)
            case "burst" | "messages":
                return self._speak(fault, done)
            case "power":
                return True
            case what:
                done.deadly = self._signal(member, _SIGNALS[what])
                return done.deadly

    def _member(self, fault: Fault) -> Member | None:
        """Return who it happens to, None where nobody of that kind lives at the moment."""
        if fault.what not in (*ENDERS, "stop", "memory"):
            return None
        if fault.target in OUTSIDE.values():
            there = [
                Member(one.name, one.pid)
                for one in self.outsiders
                if one.pid is not None and one.name == fault.target
            ]
        else:
            there = members(self.run, self.mark, self.command.pid)
        found = [one for one in there if one.kind == fault.target]
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

    def _lift_limits(self) -> None:
        """Let all have memory again: who was started by one that had little has as little."""
        pids = [*marked(self.mark), *(one.pid for one in self.outsiders if one.pid is not None)]
        for pid in pids:
            with contextlib.suppress(OSError, ValueError):
                resource.prlimit(pid, resource.RLIMIT_AS, (_FREE, _FREE))

    def _tell_car(self, number: signal.Signals) -> bool:
        car = next((one for one in self.outsiders if one.name == "car"), None)
        if car is None or car.pid is None:
            return False
        os.kill(car.pid, number)
        return True

    def _speak(self, fault: Fault, done: Done) -> bool:
        try:
            drive = running_drive(self.run)
        except UserError:
            return False
        chance = random.Random(fault.strength)
        rather = "car" if fault.what == "burst" else ""
        who = guise(drive, self.campaign, self.scratch, chance, rather=rather)
        done.words = who.name

        def speak() -> None:
            try:
                done.words = (
                    burst(who, drive.run_id, fault.for_s)
                    if fault.what == "burst"
                    else say_anything(who, drive.run_id, chance)
                )
            except Exception as error:
                done.words = f"{who.name}, {type(error).__name__}: {error}"[:120]

        self._threads.append(threading.Thread(target=speak, daemon=True))
        self._threads[-1].start()
        return True
