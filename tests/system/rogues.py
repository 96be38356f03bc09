"""Rogues on a drive's bus: who each is, what it tries, and where run.json counts the refusal.

The one table is played over TLS (`test_rogues_over_tls.py`) and on a host's own socket
(`test_rogues.py`), where each process has a name of its own.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any, Literal, NamedTuple

import zenoh

from foretwin.contracts.codec import encode
from foretwin.contracts.drive import AdvanceRequest, DriveEnd, GnssFix
from foretwin.contracts.frames import GeoPoint
from foretwin.contracts.keys import PREFIX, TELEMETRY_CHANNELS, BusRole, alive_key, key
from foretwin.contracts.simulation import BuildRequest, Event, RunEnd
from foretwin.contracts.towards_vehicle import Authority, Injection, VehicleCommand
from foretwin.contracts.tuning import SetRequest
from foretwin.orchestrator.runtime_configuration.handler import NOT_TO_BE_SET

Transport = Literal["tls", "socket"]
Act = Callable[[zenoh.Session, str], Any]
ROGUE = "rogue"
"""Stands in every text and id that a rogue sends, so that what got through is found."""
FAR_AWAY = GeoPoint(-33.9, 18.4)
FINDINGS = "gap", "gap_alarm", "verdict", "identification"


class Counted(NamedTuple):
    """A row of run.json: by the router, of a name (empty: nobody's), what it may not do on which
    key; or by the orchestrator's guard, of which key, why."""

    part: Literal["refused_by_router", "refused"]
    who: str
    what: str
    key: str = ""


class Rogue(NamedTuple):
    """Somebody who oversteps its role; `act` returns what it heard back, if anything.

    `user` is whose password it shows on the socket; `counted` gets the run's id and its name.
    """

    name: str
    role: BusRole
    user: str
    act: Act
    counted: Callable[[str, str], tuple[Counted, ...]]
    over: tuple[Transport, ...] = ("tls", "socket")


class Stranger(NamedTuple):
    """Somebody who is not let in at all: what it shows, and as what the router counts it."""

    shows: str
    counted_as: str
    over: Transport


STRANGERS = (
    Stranger("no certificate", "no certificate", "tls"),
    Stranger("another campaign's certificate", "another campaign's certificate", "tls"),
    Stranger("an expired certificate", "an expired certificate", "tls"),
    Stranger("plain TCP", "no TLS", "tls"),
    Stranger("the router's own certificate", "a certificate that is no client's", "tls"),
    Stranger("no password", "no password", "socket"),
    Stranger("a guessed password", "a wrong password", "socket"),
    Stranger("another role's password", "a wrong password", "socket"),
    Stranger("a name that nobody has", "an unknown name", "socket"),
)


def put(session: zenoh.Session, full_key: str, data: bytes) -> None:
    """Send what must not be lost on the way: a rogue that is not heard shows nothing."""
    session.put(full_key, data, congestion_control=zenoh.CongestionControl.BLOCK)


def _below(place: str) -> Callable[[str], str]:
    return lambda run: f"{PREFIX}/{place.format(run=run)}"


def _rule(what: str, place: str) -> Callable[[str, str], tuple[Counted, ...]]:
    return lambda run, name: (Counted("refused_by_router", name, what, place.format(run=run)),)


def _guard(why: str, *places: str) -> Callable[[str, str], tuple[Counted, ...]]:
    return lambda run, _: tuple(Counted("refused", place.format(run=run), why) for place in places)


def _says(message: Callable[[], bytes], *places: str) -> Act:
    def act(session: zenoh.Session, run: str) -> None:
        for place in places:
            for _ in range(3):
                put(session, _below(place)(run), message())

    return act


def _breaks_a_rule(
    name: str, role: BusRole, user: str, message: Callable[[], bytes], place: str,
    *, over: tuple[Transport, ...] = ("tls", "socket"),
) -> Rogue:  # fmt: skip
    return Rogue(name, role, user, _says(message, place), _rule("say", place), over)


def _asks(question: Callable[[], bytes], place: str, *, timeout_s: float = 2.0) -> Act:
    def act(session: zenoh.Session, run: str) -> list[Any]:
        return list(session.get(_below(place)(run), payload=question(), timeout=timeout_s))

    return act


def _serves(place: str) -> Act:
    def act(session: zenoh.Session, run: str) -> Any:
        full_key = _below(place)(run)
        return session.declare_queryable(
            full_key, lambda query: query.reply(full_key, ROGUE), complete=True
        )

    return act


def _token(process: str) -> Act:
    def act(session: zenoh.Session, run: str) -> Any:
        full_key = alive_key(run=run, process="x").removesuffix("x") + process
        return session.liveliness().declare_token(full_key)

    return act


def _deletes(session: zenoh.Session, run: str) -> None:
    session.delete(key("round", run=run), congestion_control=zenoh.CongestionControl.BLOCK)


def _listens_to_all(session: zenoh.Session, run: str) -> Any:
    return session.declare_subscriber("**", lambda _: None)


def _fix() -> bytes:
    fix = GnssFix(stamp_ns=time.time_ns(), position=FAR_AWAY)
    return encode(fix, sent_ns=time.time_ns(), sender=77)


def _end() -> bytes:
    return encode(DriveEnd(stamp_ns=0, published={}, reason=ROGUE))


def _event() -> bytes:
    return encode(Event(stamp_ns=0, source=ROGUE, level="error", text=ROGUE))


def _authority() -> bytes:
    return encode(Authority(sent_mono_ns=time.monotonic_ns()))


def _injection() -> bytes:
    told = Injection(
        stamp_ns=time.time_ns(), gate="open", reason="well", fence_m=56.0, margin_m=0.0
    )
    return encode(told, sent_ns=time.time_ns())


def _run_end() -> bytes:
    return encode(RunEnd(stamp_ns=0))


def _ghost() -> bytes:
    return encode(SetRequest(key="role.ego", value="ghost"))


def _path_to_set() -> bytes:
    return encode(SetRequest(key="vehicle.../../etc/passwd", value=ROGUE))


def _path_to_build() -> bytes:
    return encode(BuildRequest(intersection_id="../../etc/passwd", radius_m=50.0))


def _advance() -> bytes:
    return encode(AdvanceRequest(until_stamp_ns=2**62))


def _command() -> bytes:
    order = VehicleCommand(
        stamp_ns=0, sent_mono_ns=time.monotonic_ns(), tire_angle_rad=0.4, accel_mps2=1.0,
        speed_mps=8.0,
    )  # fmt: skip
    return encode(order)


def _no_message() -> bytes:
    return f"{ROGUE} and no message".encode()


_EGO, _RUN = "vehicle/ego/telemetry", "run/{run}"
_TELEMETRY = tuple(f"{_EGO}/{one}" for one in TELEMETRY_CHANNELS)
_PATHS = "/../../etc/passwd"
_FORGED_LINE = (
    "2026-01-01T00:00:00.000000Z TRACE  rx-0 ThreadId(08) "
    "zenoh::net::routing::interceptor::access_control: 0a on Username(orchestrator)+0a is "
    "unauthorized to Put (ingress) on forged"
)

ROGUES: tuple[Rogue, ...] = (
    # What the rules refuse.
    _breaks_a_rule("a worker speaks as the car", "worker", "worker-w0", _fix, f"{_EGO}/gnss"),
    _breaks_a_rule("a worker ends the car's drive", "worker", "worker-w0", _end, f"{_EGO}/end"),
    _breaks_a_rule("a viewer publishes", "viewer", "viewer", _event, f"{_RUN}/event"),
    _breaks_a_rule("a viewer speaks as the car", "viewer", "viewer", _fix, f"{_EGO}/gnss"),
    _breaks_a_rule("a recorder forges the orchestrator's word", "recorder", "recorder",
                   _authority, f"{_RUN}/authority"),
    _breaks_a_rule("a planner forges the orchestrator's word", "planner", "planner",
                   _authority, f"{_RUN}/authority"),
    _breaks_a_rule("an operator commands the vehicle", "operator", "operator",
                   _command, f"{_RUN}/vehicle_command"),
    _breaks_a_rule("an operator says that a gate is open", "operator", "operator",
                   _injection, "vehicle/ego/injection"),
    _breaks_a_rule("a worker says that a gate is open", "worker", "worker-w0",
                   _injection, "vehicle/ego/injection"),
    _breaks_a_rule("the car ends the run", "car", "car-vehicle", _run_end, f"{_RUN}/run_end"),
    _breaks_a_rule("a planner ends the run", "planner", "planner", _run_end, f"{_RUN}/run_end"),
    _breaks_a_rule("a worker poses as the mirror", "worker", "worker-w0",
                   _no_message, f"{_RUN}/mirror", over=("socket",)),
    _breaks_a_rule("a viewer says it on every key", "viewer", "viewer", _no_message, "**"),
    _breaks_a_rule("a viewer names a path as its vehicle", "viewer", "viewer",
                   _fix, "vehicle/../../etc/passwd/telemetry/gnss"),
    _breaks_a_rule("a viewer writes the router's log", "viewer", "viewer",
                   _no_message, f"x\n{_FORGED_LINE}"),
    Rogue("a viewer changes the drive", "viewer", "viewer", _asks(_ghost, f"{_RUN}/set"),
          _rule("ask", f"{_RUN}/set")),
    Rogue("an operator drives on a recorded car", "operator", "operator",
          _asks(_advance, "vehicle/ego/advance"), _rule("ask", "vehicle/ego/advance")),
    Rogue("a viewer has a World built at a path", "viewer", "viewer",
          _asks(_path_to_build, f"{_RUN}/builder/builder/build"),
          _rule("ask", f"{_RUN}/builder/builder/build")),
    Rogue("a worker answers for the orchestrator", "worker", "worker-w0",
          _serves(f"{_RUN}/set"), _rule("serve", f"{_RUN}/set")),
    Rogue("a worker takes another's jobs", "worker", "worker-w0",
          _serves(f"{_RUN}/worker/mirror/job"),
          _rule("serve", f"{_RUN}/worker/mirror/job"), ("socket",)),
    Rogue("a viewer says that it is a worker", "viewer", "viewer", _token("w9"),
          _rule("be alive as", f"{_RUN}/alive/w9")),
    Rogue("a worker says that it is another one", "worker", "worker-w0", _token("w1"),
          _rule("be alive as", f"{_RUN}/alive/w1"), ("socket",)),
    Rogue("an operator is alive under a path", "operator", "operator", _token(_PATHS[1:]),
          _rule("be alive as", f"{_RUN}/alive{_PATHS}")),
    Rogue("a viewer takes back what was said", "viewer", "viewer", _deletes,
          _rule("delete", f"{_RUN}/round")),
    Rogue("a planner listens to all", "planner", "planner", _listens_to_all,
          _rule("hear", "**")),
    # What the guard refuses of who may speak.
    Rogue("an operator names a path", "operator", "operator",
          _asks(_path_to_set, f"{_RUN}/set", timeout_s=60.0),
          _guard(NOT_TO_BE_SET, f"{_RUN}/set")),
    Rogue("an operator asks for nothing", "operator", "operator",
          _asks(_no_message, f"{_RUN}/set", timeout_s=60.0), _guard("no message", f"{_RUN}/set")),
    Rogue("the mirror sends no messages", "worker", "worker-mirror",
          _says(_no_message, f"{_RUN}/mirror"), _guard("no message", f"{_RUN}/mirror")),
    Rogue("the mirror sends too much", "worker", "worker-mirror",
          _says(lambda: bytes(33 * 2**20), f"{_RUN}/mirror"),
          _guard("too large", f"{_RUN}/mirror")),
    Rogue("tuning sends no messages", "worker", "worker-tuning",
          _says(_no_message, *(f"{_RUN}/{one}" for one in FINDINGS)),
          _guard("no message", *(f"{_RUN}/{one}" for one in FINDINGS))),
    Rogue("the recorder sends no messages", "recorder", "recorder",
          _says(_no_message, f"{_RUN}/event"), _guard("no message", f"{_RUN}/event")),
    Rogue("a car sends no messages", "car", "car-vehicle", _says(_no_message, *_TELEMETRY),
          _guard("no message", *_TELEMETRY)),
    Rogue("a car sends too much", "car", "car-vehicle",
          _says(lambda: bytes(8 * 2**20), f"{_EGO}/gnss"), _guard("too large", f"{_EGO}/gnss")),
)  # fmt: skip


def rogues_over(transport: Transport) -> tuple[Rogue, ...]:
    """Return those that make sense there."""
    return tuple(one for one in ROGUES if transport in one.over)
