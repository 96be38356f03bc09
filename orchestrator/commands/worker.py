"""The command `worker`: processes that join a drive on another machine, and leave with it."""

from __future__ import annotations

import datetime
import os
import re
import socket
import time
from pathlib import Path
from typing import NamedTuple

from foretwin.contracts.bus import Alive, BusUnreachable, Mailbox, ZenohBus
from foretwin.contracts.campaign import certificate_in, role_files, worker_name
from foretwin.contracts.certificates import UTC, read_certificate, time_trouble
from foretwin.contracts.errors import UserError
from foretwin.contracts.exit_codes import USER
from foretwin.contracts.fleet import far_id
from foretwin.contracts.keys import alive_key, run_of_alive_key
from foretwin.contracts.new_folder import trouble_with_folder
from foretwin.contracts.owned_folder import make_temporary
from foretwin.contracts.ports import trouble_with_bus
from foretwin.contracts.process_setup import BusSetup
from foretwin.contracts.setup import FarWorkerSetup
from foretwin.contracts.terminal import say
from foretwin.orchestrator.drive.exit_words import EXIT_DONE, EXIT_PARTLY
from foretwin.orchestrator.drive.interrupt import Interruption
from foretwin.orchestrator.processors import processors, trouble_with_workers
from foretwin.orchestrator.record.machine import this_machine
from foretwin.orchestrator.runner.launch import FreshInterpreter
from foretwin.orchestrator.runner.supervisor import Supervisor, WhenDead

EXIT_REFUSED = USER
DRIVE_S = 60.0
"""How long a drive may take to begin."""
DRAIN_S = 30.0
"""What workers may take for what they are at when they are told to end."""
_LOOK_S = 0.1
_AGAIN_S = 1.0
_NAME = re.compile(r"[a-z0-9]{1,40}")


class WorkerRequest(NamedTuple):
    """What the command line says."""

    connect: str
    secure: Path | None = None
    insecure: bool = False
    name: str | None = None
    workers: int | None = None
    cache: Path | None = None
    stay: bool = False


class _FarRow(NamedTuple):
    module: str = "sim_worker.far"
    when_dead: WhenDead = "report"
    nice: int = 0


def work(request: WorkerRequest) -> int:
    """Join a drive, or with `stay` one after the other; returns 0, 2 where the drive does not want
    these workers, 3 where something went wrong meanwhile.

    Raises UserError for what cannot be used, and where no drive is there.
    """
    bus, name = _bus_and_name(request)
    count = processors() if request.workers is None else request.workers
    if (trouble := trouble_with_workers(count)) is not None:
        raise UserError(trouble)
    cache = request.cache or _default_cache()
    if (trouble := trouble_with_folder(cache)) is not None:
        raise UserError(f"--cache {cache}: {trouble}")
    cache.mkdir(parents=True, exist_ok=True)
    ended = Interruption()
    code = EXIT_DONE
    while not ended.asked:
        try:
            run_id = drive_at(bus, ended)
        except UserError as nobody:
            if not request.stay:
                raise
            say(f"foretwin: {nobody}; waiting", error=True)
            _wait(_AGAIN_S, ended)
            continue
        if run_id is None:
            break
        with _Party(bus, name, count, cache, run_id) as party:
            code = party.play(ended)
        if not request.stay or code == EXIT_REFUSED:
            break
    return code


def _bus_and_name(request: WorkerRequest) -> tuple[BusSetup, str]:
    """Return how to reach the drive, and what this machine is called there."""
    secure = None if request.secure is None else str(request.secure)
    trouble = trouble_with_bus(request.connect, insecure=request.insecure, secure=secure)
    if trouble is not None:
        raise UserError(trouble.replace("endpoint", "--connect", 1))
    certified = None
    tls = None
    if request.secure is not None:
        role = f"worker-{request.name}"
        copied = not (request.secure / role).is_dir()
        tls = certificate_in(request.secure) if copied else role_files(request.secure, role)
        certificate = read_certificate(Path(tls.certificate))
        if line := time_trouble(certificate, tls.certificate, now=_now()):
            raise UserError(line)
        certified = worker_name(certificate.name)
        if certified is None:
            raise UserError(
                f"{tls.certificate}: is of {certificate.name}, not of a machine; "
                "`foretwin secure add worker-NAME` makes one, and its folder is what this needs"
            )
        if request.name not in (None, certified):
            raise UserError(f"--name {request.name}: its certificate is that of {certified}")
    host = re.sub(r"[^a-z0-9]", "", socket.gethostname().lower())[:40] or "machine"
    name = certified or request.name or host
    if _NAME.fullmatch(name) is None:
        raise UserError(f"--name {name!r}: small letters and digits, at most 40")
    return BusSetup(endpoint=request.connect, tls=tls), name


def drive_at(setup: BusSetup, ended: Interruption) -> str | None:
    """Return the id of the run whose orchestrator is there, None where it was ended before.

    Raises UserError where nobody lets us in, or nobody drives.
    """
    try:
        bus = ZenohBus(setup)
    except BusUnreachable as error:
        # What Zenoh says of it names files of its own.
        why = str(error).removeprefix(f"no Zenoh router at {setup.endpoint}: ")
        why = "nobody answers there: is the drive running?" if "Unable to connect" in why else why
        raise UserError(f"--connect {setup.endpoint}: {why}") from None
    with bus:
        seen = Mailbox(16)
        bus.watch_alive(alive_key(run="*", process="orchestrator"), seen)
        until_s = time.monotonic() + DRIVE_S
        while time.monotonic() < until_s:
            if ended.asked:
                return None
            item = seen.take(_LOOK_S)
            if isinstance(item, Alive) and item.up:
                return run_of_alive_key(item.key)
    raise UserError(f"--connect {setup.endpoint}: no drive has begun there in {DRIVE_S:g} s")


class _Party:
    """The worker processes of this machine in one drive."""

    def __init__(self, bus: BusSetup, name: str, count: int, cache: Path, run_id: str) -> None:
        self._ids = [far_id(name, number) for number in range(count)]
        self._bus, self._cache, self._run_id = bus, cache, run_id
        self._folder = make_temporary("foretwin-worker-")
        self._supervisor = Supervisor(FreshInterpreter(self._folder.path))
        self._read: dict[str, int] = {}
        self._said: set[str] = set()
        self._again: dict[str, float] = {}

    def __enter__(self) -> _Party:
        for process_id in self._ids:
            self._start(process_id)
        say(f"joins run {self._run_id} as {', '.join(self._ids)}", error=True)
        return self

    def __exit__(self, *what: object) -> None:
        self._supervisor.stop(grace_s=0.0, term_s=DRAIN_S)
        self._listen()
        self._folder.remove()

    def play(self, ended: Interruption) -> int:
        """Look after the processes until all have left, or this one is told to end."""
        codes: dict[str, int] = {}
        while len(codes) < len(self._ids) and not ended.asked:
            now_s = time.monotonic()
            for death in self._supervisor.poll(now_s):
                if death.exit_code in (EXIT_DONE, EXIT_REFUSED):
                    codes[death.process_id] = death.exit_code
                    continue
                pause_s = self._supervisor.pause_s(death.process_id, now_s)
                text = f"{death.process_id} ended with code {death.exit_code}"
                if pause_s is None:
                    codes[death.process_id] = EXIT_PARTLY
                    self._tell(f"{text} again and again")
                else:
                    self._tell(f"{text}; started again")
                    self._again[death.process_id] = now_s + pause_s
            for process_id in [one for one, at_s in self._again.items() if now_s >= at_s]:
                del self._again[process_id]
                self._start(process_id)
            self._listen()
            _wait(_LOOK_S, ended)
        self._listen()
        if EXIT_REFUSED in codes.values():
            return EXIT_REFUSED
        return EXIT_PARTLY if self._said else EXIT_DONE

    def _start(self, process_id: str) -> None:
        setup = FarWorkerSetup(
            run_id=self._run_id,
            process_id=process_id,
            vehicle_id="far",
            bus=self._bus,
            log_file=str(self._cache / "worker.jsonl"),
            machine=this_machine(),
            cache_dir=str(self._cache),
        )
        self._supervisor.start(_FarRow(), setup)

    def _listen(self) -> None:
        """Say once what the processes have to say."""
        for file in sorted(self._folder.path.glob("*.stderr")):
            with file.open("rb") as said:
                said.seek(self._read.get(file.name, 0))
                data = said.read()
            whole = data[: data.rfind(b"\n") + 1]
            self._read[file.name] = self._read.get(file.name, 0) + len(whole)
            for line in whole.decode(errors="replace").splitlines():
                self._tell(line.removeprefix(f"{file.stem}: "))

    def _tell(self, text: str) -> None:
        if text and text not in self._said:
            self._said.add(text)
            say(f"foretwin: {text}", error=True)


def _wait(seconds: float, ended: Interruption) -> None:
    until_s = time.monotonic() + seconds
    while not ended.asked and time.monotonic() < until_s:
        time.sleep(min(0.05, seconds))


def _default_cache() -> Path:
    base = os.environ.get("XDG_CACHE_HOME")
    return (Path(base) if base else Path.home() / ".cache") / "foretwin" / "far-worlds"


def _now() -> datetime.datetime:
    return datetime.datetime.now(UTC)
