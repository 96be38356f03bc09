"""Rogues on a bus: what each tries, and where it is told that it was refused.

`told` names the place: `run.json` the refusals that the orchestrator counts, `answer` what the
rogue itself hears, `rules` the access rules, of which Zenoh 1.10 tells nobody above TRACE.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any, Literal, NamedTuple

import zenoh

from foretwin.contracts.codec import encode
from foretwin.contracts.drive import DriveEnd, GnssFix
from foretwin.contracts.frames import GeoPoint
from foretwin.contracts.keys import PREFIX, TELEMETRY_CHANNELS, BusRole, alive_key, key
from foretwin.contracts.simulation import Event, RunEnd
from foretwin.contracts.towards_vehicle import Authority, VehicleCommand
from foretwin.contracts.tuning import SetRequest

Told = Literal["run.json", "answer", "rules"]
OF_A_WORKER = "mirror", "gap", "gap_alarm", "verdict", "identification"
FAR_AWAY = GeoPoint(-33.9, 18.4)
ROGUE = "rogue"
"""Stands in every text and id that a rogue sends, so that what got through is found."""


class Rogue(NamedTuple):
    """Somebody with a role who oversteps it; `act` returns what it heard back, if anything."""

    name: str
    role: BusRole
    told: Told
    act: Callable[[zenoh.Session, str], Any]


def _put(session: zenoh.Session, full_key: str, data: bytes) -> None:
    """Send what must not be lost on the way: a rogue that is not heard shows nothing."""
    session.put(full_key, data, congestion_control=zenoh.CongestionControl.BLOCK)


def _says(full_key: Callable[[str], str], message: Callable[[], bytes]) -> Any:
    def act(session: zenoh.Session, run: str) -> None:
        for _ in range(3):
            _put(session, full_key(run), message())

    return act


def _fix() -> bytes:
    fix = GnssFix(stamp_ns=time.time_ns(), position=FAR_AWAY)
    return encode(fix, sent_ns=time.time_ns(), sender=77)


def _asks(session: zenoh.Session, run: str) -> list[Any]:
    question = encode(SetRequest(key="role.ego", value="ghost"))
    return list(session.get(key("set", run=run), payload=question, timeout=2.0))


def _asks_for_a_path(session: zenoh.Session, run: str) -> list[Any]:
    question = encode(SetRequest(key="vehicle.../../etc/passwd", value=ROGUE))
    return list(session.get(key("set", run=run), payload=question, timeout=60.0))


def _answers(session: zenoh.Session, run: str) -> Any:
    return session.declare_queryable(
        key("set", run=run), lambda query: query.reply(key("set", run=run), ROGUE), complete=True
    )


def _token(process: str) -> Callable[[zenoh.Session, str], Any]:
    def act(session: zenoh.Session, run: str) -> Any:
        return session.liveliness().declare_token(alive_key(run=run, process="x") + process)

    return act


def _malformed_on_each(session: zenoh.Session, run: str) -> None:
    for channel in OF_A_WORKER:
        _put(session, key(channel, run=run), f"{ROGUE} {channel}".encode())


def _malformed_telemetry(session: zenoh.Session, run: str) -> None:
    for channel in TELEMETRY_CHANNELS:
        _put(session, key(channel, vehicle="ego"), f"{ROGUE} {channel}".encode())


def _command() -> bytes:
    order = VehicleCommand(
        stamp_ns=0, sent_mono_ns=time.monotonic_ns(), tire_angle_rad=0.4, accel_mps2=1.0,
        speed_mps=8.0,
    )  # fmt: skip
    return encode(order)


ROGUES: tuple[Rogue, ...] = (
    Rogue("a worker speaks as the car", "worker", "rules",
          _says(lambda _: key("gnss", vehicle="ego"), _fix)),
    Rogue("a worker ends the car's drive", "worker", "rules",
          _says(lambda _: key("end", vehicle="ego"),
                lambda: encode(DriveEnd(stamp_ns=0, published={}, reason=ROGUE)))),
    Rogue("a viewer publishes", "viewer", "rules",
          _says(lambda run: key("event", run=run),
                lambda: encode(Event(stamp_ns=0, source=ROGUE, level="error", text=ROGUE)))),
    Rogue("a viewer speaks as the car", "viewer", "rules",
          _says(lambda _: key("gnss", vehicle="ego"), _fix)),
    Rogue("a recorder forges the orchestrator's word", "recorder", "rules",
          _says(lambda run: key("authority", run=run),
                lambda: encode(Authority(sent_mono_ns=time.monotonic_ns())))),
    Rogue("an operator commands the vehicle", "operator", "rules",
          _says(lambda run: key("vehicle_command", run=run), _command)),
    Rogue("the car ends the run", "car", "rules",
          _says(lambda run: key("run_end", run=run), lambda: encode(RunEnd(stamp_ns=0)))),
    Rogue("a viewer changes the drive", "viewer", "rules", _asks),
    Rogue("a worker answers for the orchestrator", "worker", "rules", _answers),
    Rogue("a viewer says that it is a worker", "viewer", "rules", _token("w9")),
    Rogue("an operator is alive under a path", "operator", "rules", _token("/../../etc/passwd")),
    Rogue("a viewer says it on every key", "viewer", "rules",
          _says(lambda _: f"{PREFIX}/**", lambda: ROGUE.encode())),
    Rogue("an operator names a path", "operator", "answer", _asks_for_a_path),
    Rogue("a worker sends no messages", "worker", "run.json", _malformed_on_each),
    Rogue("a worker sends too much", "worker", "run.json",
          _says(lambda run: key("mirror", run=run), lambda: bytes(33 * 2**20))),
    Rogue("a car sends no messages", "car", "run.json", _malformed_telemetry),
    Rogue("a car sends too much", "car", "run.json",
          _says(lambda _: key("gnss", vehicle="ego"), lambda: bytes(8 * 2**20))),
)  # fmt: skip
