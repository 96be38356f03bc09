"""The command `join`: a car beside that of a running drive, from a lot of its own."""

from __future__ import annotations

import contextlib
import json
import secrets
import time
from contextlib import closing
from pathlib import Path
from typing import Any, NamedTuple

import msgspec

from foretwin.contracts.anchor_file import AnchorFile, read_anchor
from foretwin.contracts.bus import Bus, BusUnreachable, ask
from foretwin.contracts.certificates import read_certificate
from foretwin.contracts.errors import UserError
from foretwin.contracts.exit_codes import USER
from foretwin.contracts.frames import LocalFrame
from foretwin.contracts.guard import is_identifier
from foretwin.contracts.joining import newest_running, running_drive
from foretwin.contracts.local_bus import CAR_OF
from foretwin.contracts.owned_folder import temporary_folder
from foretwin.contracts.ports import trouble_with_bus
from foretwin.contracts.process_setup import BusSetup, ProcessSetup
from foretwin.contracts.redialled_bus import RedialledBus
from foretwin.contracts.roles import JoinReply, JoinRequest
from foretwin.contracts.setup import ReplaySetup, Ros2Setup, StandinSetup
from foretwin.contracts.terminal import say
from foretwin.orchestrator.campaign.joining import own_certificate
from foretwin.orchestrator.commands.standin import way_in_world
from foretwin.orchestrator.commands.worker import drive_at
from foretwin.orchestrator.drive.exit_words import EXIT_DONE, EXIT_PARTLY
from foretwin.orchestrator.drive.interrupt import Interruption
from foretwin.orchestrator.record.which_run import run_folder
from foretwin.orchestrator.runner.launch import FreshInterpreter
from foretwin.orchestrator.runner.supervisor import Supervisor, WhenDead
from foretwin.telemetry.logs import open_log
from foretwin.telemetry.processes.replay import ReplaySource
from foretwin.telemetry.ros2.mapping import read_mapping

STANDIN = "telemetry.standin"
TOLD_S = 20.0
"""So long may what is missing stay away: a clock that is known, or the drive's own car."""
NO_SEAT_S = 10.0
"""So long it may be until a drive that has begun answers."""
LEAST_M = 5.0
"""A stand-in's path is longer."""
ASK_EVERY_S, ANSWER_S = 1.0, 10.0
_LOOK_S = 0.05


class JoinAsked(NamedTuple):
    """What was asked for on the command line."""

    vehicle_id: str
    anchor: Path
    log: Path | None = None
    ros2: Path | None = None
    route: Path | None = None
    way_m: float = 100.0
    speed_mps: float = 8.0
    run: Path | None = None
    out: Path = Path("runs")
    connect: str | None = None
    secure: Path | None = None
    insecure: bool = False


class _Row(NamedTuple):
    module: str
    when_dead: WhenDead = "report"
    nice: int = 0


class _Place(NamedTuple):
    """How the run is reached, and which it is."""

    bus: BusSetup
    run_id: str


def join(asked: JoinAsked) -> int:
    """Speak as a vehicle beside the car until told to end, or its source or the drive is over.

    Returns 0, or 3 where its process broke. Raises UserError, in one line, for what cannot be used
    and where the drive does not want it.
    """
    anchor = read_anchor(asked.anchor)
    _check(asked)
    ended = Interruption()
    place = _place(asked, ended)
    if place is None:
        return EXIT_DONE
    request = JoinRequest(instance=secrets.token_hex(8), scale=anchor.scale)
    with (
        closing(_bus(place)) as bus,
        temporary_folder("foretwin-join-") as folder,
    ):
        seat = _AskedSeat(bus, place.run_id, asked.vehicle_id, request)
        frame = seat.take(ended)
        if frame is None:
            return EXIT_DONE
        supervisor = Supervisor(FreshInterpreter(folder))
        row, setup = _process(asked, anchor, place, frame, folder)
        supervisor.start(row, setup)
        try:
            return _look_after(supervisor, seat, ended, folder)
        finally:
            supervisor.stop(grace_s=0.0)
            seat.leave()


def _bus(place: _Place) -> RedialledBus:
    try:
        return RedialledBus(place.bus)
    except BusUnreachable:
        raise UserError(
            f"run {place.run_id}: nobody listens at {place.bus.endpoint}, though the drive goes on"
        ) from None


def _check(asked: JoinAsked) -> None:
    if not is_identifier(asked.vehicle_id):
        raise UserError(
            f"{asked.vehicle_id!r}: one word, the id of one of the drive's [[vehicles]]"
        )
    given = [name for name in ("log", "ros2", "route") if getattr(asked, name) is not None]
    if len(given) > 1:
        both = " and ".join(f"--{name}" for name in given)
        raise UserError(f"{both}: one of them, or none for the stand-in car straight on")
    for name, value, least in (("--way", asked.way_m, LEAST_M), ("--speed", asked.speed_mps, 0.0)):
        if not least < value < 10_000.0:
            raise UserError(f"{name} {value:g}: above {least:g}")
    if asked.log is not None:
        ReplaySource(open_log(asked.log), vehicle_id=asked.vehicle_id)
    if asked.ros2 is not None and read_mapping(asked.ros2).mapping.endpoint is None:
        raise UserError(f"{asked.ros2}: endpoint must be named: where the car's router listens")


def _place(asked: JoinAsked, ended: Interruption) -> _Place | None:
    """Return where the drive is, None where this was ended before; raises UserError."""
    endpoint, name = asked.connect, "--connect"
    if endpoint is None:
        drive = (
            newest_running(asked.out)
            if asked.run is None
            else running_drive(run_folder(asked.run, asked.out))
        )
        if not drive.endpoint.startswith("tls/"):
            bus = drive.bus(f"{CAR_OF}{asked.vehicle_id}")
            if bus.credentials is not None and not Path(bus.credentials).is_file():
                how = "seats are those of [[vehicles]] with live = true and without ros2"
                raise UserError(f"{drive.folder}: {asked.vehicle_id} has no seat here: {how}")
            return _Place(bus, drive.run_id)
        endpoint, name = drive.endpoint, f"{drive.folder}:"
    secure = None if asked.secure is None else str(asked.secure)
    if trouble := trouble_with_bus(endpoint, insecure=asked.insecure, secure=secure):
        raise UserError(trouble.replace("endpoint", name, 1))
    tls = None
    if asked.secure is not None:
        tls = own_certificate(asked.secure, "car")
        whose = read_certificate(Path(tls.certificate)).name
        if whose != "car":
            raise UserError(f"{tls.certificate}: is of {whose}, not of a car")
    bus = BusSetup(endpoint=endpoint, tls=tls)
    run_id = drive_at(bus, ended)
    return None if run_id is None else _Place(bus, run_id)


def _process(
    asked: JoinAsked, anchor: AnchorFile, place: _Place, frame: LocalFrame, folder: Path
) -> tuple[_Row, ProcessSetup]:
    """Return what speaks for the vehicle, and what it is started with."""
    given: dict[str, Any] = {
        "run_id": place.run_id,
        "process_id": f"{CAR_OF}{asked.vehicle_id}",
        "vehicle_id": asked.vehicle_id,
        "bus": place.bus,
        "log_file": str(folder / "log.jsonl"),
        "anchor": anchor.anchor,
    }
    if asked.log is not None:
        return _Row("telemetry.processes.replay"), ReplaySetup(**given, log=str(asked.log))
    if asked.ros2 is not None:
        mapping = read_mapping(asked.ros2)
        setup = Ros2Setup(
            **given,
            mapping=mapping.text,
            mapping_name=mapping.name,
            drive_frame=frame,
            listens_only=True,  # the keys of what moves a car stay with the drive
        )
        return _Row("telemetry.ros2"), setup
    path_file = folder / "path.json"
    way = way_in_world(anchor, route=asked.route, way_m=asked.way_m, speed_mps=asked.speed_mps)
    line = {name: column.tolist() for name, column in way._asdict().items()}
    path_file.write_text(json.dumps(line), encoding="utf-8")
    standin = StandinSetup(**given, path_file=str(path_file), beside=True)
    return _Row(STANDIN), standin


class _AskedSeat:
    """The right to speak as one vehicle: asked for, and again every second."""

    def __init__(self, bus: Bus, run_id: str, vehicle_id: str, request: JoinRequest) -> None:
        self._bus, self._run_id, self._id, self._request = bus, run_id, vehicle_id, request
        self._since_s = time.monotonic()
        self._told, self._answered = "", False

    def take(self, ended: Interruption) -> LocalFrame | None:
        """Return the drive's plane once the vehicle may speak, None where this was ended before."""
        while not ended.asked:
            reply = self.ask()
            if reply.drive_frame is not None:
                say(f"joins run {self._run_id} as {self._id}", error=True)
                self._since_s = time.monotonic()
                return reply.drive_frame
            _wait(ASK_EVERY_S, ended)
        return None

    def ask(self, *, leaves: bool = False) -> JoinReply:
        """Ask, and return what is said.

        Raises UserError where the drive does not want it, or something is missing for too long.
        """
        request = msgspec.structs.replace(self._request, leaves=leaves)
        ids = {"run": self._run_id, "vehicle": self._id}
        try:
            reply: JoinReply = ask(self._bus, "join", request, timeout_s=ANSWER_S, **ids)
            self._answered = True
        except TimeoutError:
            text = f"run {self._run_id} has no seat for {self._id}, or does not answer"
            reply = JoinReply(trouble=text)
        if reply.refused:
            raise UserError(reply.refused)
        how = reply.clock.rpartition("(")[2]
        if how != self._told and how:
            self._told = how
            say(f"{self._id}: {reply.clock}", error=True)
        most_s = TOLD_S if self._answered else NO_SEAT_S
        late = time.monotonic() - self._since_s > most_s
        if reply.trouble and late and not (self._told or leaves):
            raise UserError(f"{reply.trouble} (for {most_s:g} s)")
        return reply

    def leave(self) -> None:
        """Give the seat back, where anybody listens."""
        with contextlib.suppress(UserError):
            self.ask(leaves=True)


def _look_after(supervisor: Supervisor, seat: _AskedSeat, ended: Interruption, folder: Path) -> int:
    """Return the exit code once the vehicle's process, or this one, ends."""
    next_s = 0.0
    while not ended.asked:
        now_s = time.monotonic()
        for death in supervisor.poll(now_s):
            said = (folder / f"{death.process_id}.stderr").read_text(errors="replace").split("\n")
            if death.exit_code == USER:
                raise UserError(said[0].removeprefix(f"{death.process_id}: "))
            if death.exit_code == EXIT_DONE:
                say("the drive is over", error=True)
                return EXIT_DONE
            say(f"{death.process_id} ended with code {death.exit_code}", error=True)
            return EXIT_PARTLY
        if now_s >= next_s:
            next_s = now_s + ASK_EVERY_S
            reply = seat.ask()
            if reply.over:
                say("has driven to its end", error=True)
                return EXIT_DONE
        _wait(_LOOK_S, ended)
    return EXIT_DONE


def _wait(seconds: float, ended: Interruption) -> None:
    until_s = time.monotonic() + seconds
    while not ended.asked and time.monotonic() < until_s:
        time.sleep(_LOOK_S)
