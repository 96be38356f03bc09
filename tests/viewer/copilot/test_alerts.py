"""Each kind of alert: what makes it, what ends it, and which comes first."""

from __future__ import annotations

from collections.abc import Callable

import msgspec
import pytest

from foretwin.contracts.gap import GapAlarm
from foretwin.contracts.simulation import Event, WorkerStatus
from foretwin.contracts.too_old import STALE_S
from foretwin.contracts.towards_vehicle import GateReason, GateState, Injection
from foretwin.viewer.copilot.alerts import EVENT_SHOWN_S, NO_ROUND_S, Alert, Alerts
from tests.viewer.copilot.rounds import round_of
from tests.viewer.copilot.test_words import AHEAD, verdict
from tests.viewer.scene import state_at


def well() -> Alerts:
    """Return the alerts of a drive at 10 s in which nothing is wrong."""
    alerts = Alerts(0.0)
    alerts.alive("w0", up=True)
    alerts.progress(AHEAD, 9.0)
    alerts.round(round_of(), 9.8)
    alerts.state(state_at(10.0), 10.0)
    return alerts


def gap(*, over: bool) -> GapAlarm:
    return GapAlarm(
        vehicle_id="ego",
        stamp_ns=1,
        quantity="along_m",
        value=-2.4,
        limit=1.6,
        manoeuvre="braking",
        over=over,
    )


def late_rounds(alerts: Alerts) -> None:
    for late in (False, True, True):
        alerts.round(msgspec.structs.replace(round_of(late=late), latency_ms=812.0), 9.9)


def worker(state: str) -> WorkerStatus:
    return msgspec.convert({"stamp_ns": 1, "worker_id": "w1", "state": state}, WorkerStatus)


def injection(gate: GateState, reason: GateReason = "near the fence") -> Injection:
    return Injection(stamp_ns=1, gate=gate, reason=reason, fence_m=12.3, margin_m=29.4)


FORCED: dict[str, tuple[Callable[[Alerts], object], Alert]] = {
    "run ended": (lambda one: one.end("the run has ended"), Alert("ended", "the run has ended")),
    "process gone": (
        lambda one: one.alive("recorder", up=False),
        Alert("process", "process gone: recorder"),
    ),
    "overdue": (
        lambda one: one.state(msgspec.structs.replace(state_at(10.0), stale=("gnss", "imu")), 10.0),
        Alert("telemetry", "telemetry overdue: gnss, imu"),
    ),
    "gate shut": (
        lambda one: one.injection(injection("shut")),
        Alert("injection", "virtual objects are off for good: near the fence"),
    ),
    "verdict": (
        lambda one: one.verdict(verdict("vehicle")),
        Alert("verdict", "verdict: steering turns 12 % less than told"),
    ),
    "gap": (
        lambda one: one.gap(gap(over=True)),
        Alert("gap", "gap beyond limit: along 2.4 of 1.6 m, braking"),
    ),
    "late rounds": (late_rounds, Alert("rounds", "rounds late: the last took 812 ms")),
    "off the map": (
        lambda one: one.progress(msgspec.structs.replace(AHEAD, mission_state="off_map"), 10.0),
        Alert("off_map", "off the map: no rounds"),
    ),
    "sick worker": (
        lambda one: one.worker(worker("sick")),
        Alert("worker", "worker: w1 is sick"),
    ),
    "event": (
        lambda one: one.event(
            Event(stamp_ns=1, level="error", source="x", text="no world for n4"), 10.0
        ),
        Alert("event", "no world for n4"),
    ),
}


def test_of_a_drive_that_goes_well_nothing_is_said() -> None:
    assert well().now(10.0) == []


@pytest.mark.parametrize("kind", FORCED)
def test_what_is_wrong_is_said_with_its_cause(kind: str) -> None:
    force, said = FORCED[kind]
    alerts = well()
    force(alerts)
    assert alerts.now(10.0) == [said]


@pytest.mark.parametrize("gate", ["off", "waiting", "open"])
def test_a_gate_that_has_not_shut_is_no_alert(gate: GateState) -> None:
    alerts = well()
    alerts.injection(injection(gate))
    assert alerts.now(10.0) == []


def test_telemetry_is_stale_after_a_second_and_the_age_is_told() -> None:
    assert well().now(10.0 + STALE_S) == []
    assert well().now(10.1 + STALE_S) == [Alert("telemetry", "telemetry stale: 1 s")]
    assert Alerts(0.0).now(3.0) == [Alert("telemetry", "no telemetry yet: 3 s")]


def test_a_link_that_is_gone_comes_before_what_follows_from_it() -> None:
    alerts = well()
    alerts.verdict(verdict("model"))
    kinds = [one.kind for one in alerts.now(15.0, linked=False)]
    assert kinds == ["link", "telemetry", "verdict", "rounds"]


def test_no_round_for_a_while_is_told_where_one_is_due() -> None:
    alerts = well()
    late_s = 9.9 + NO_ROUND_S
    alerts.state(state_at(11.0), late_s)
    assert alerts.now(late_s) == [Alert("rounds", "no futures for 4 s")]
    alerts.progress(msgspec.structs.replace(AHEAD, junction_id=None), late_s)
    assert alerts.now(late_s) == []
    alerts.progress(AHEAD, late_s)
    assert alerts.now(late_s + 0.5) == [], "from now on one is waited for"


def test_what_is_well_again_is_not_said_any_more() -> None:
    alerts = well()
    alerts.alive("w0", up=False)
    alerts.alive("w0", up=True)
    alerts.gap(gap(over=True))
    alerts.gap(gap(over=False))
    alerts.verdict(verdict("vehicle"))
    alerts.verdict(verdict("none"))
    late_rounds(alerts)
    alerts.round(round_of(), 10.0)
    alerts.worker(worker("dead"))
    alerts.worker(worker("busy"))
    assert alerts.now(10.0) == []


def test_an_event_is_shown_for_a_while_and_information_never() -> None:
    alerts = well()
    alerts.event(Event(stamp_ns=1, level="info", source="x", text="on the map"), 10.0)
    assert alerts.now(10.0) == []
    alerts.event(Event(stamp_ns=1, level="warning", source="x", text="disk full"), 10.0)
    late_s = 10.0 + EVENT_SHOWN_S
    alerts.state(state_at(20.0), late_s)
    alerts.round(round_of(), late_s)
    assert alerts.now(late_s) == [Alert("event", "disk full")]
    assert alerts.now(late_s + 0.1) == []


def test_a_worker_that_is_gone_is_told_once() -> None:
    alerts = well()
    alerts.alive("w1", up=False)
    alerts.worker(worker("dead"))
    assert alerts.now(10.0) == [Alert("process", "process gone: w1")]


def test_after_the_end_the_first_cause_stands_alone() -> None:
    alerts = well()
    alerts.alive("w0", up=False)
    alerts.end("the run has ended")
    alerts.end("another")
    assert alerts.now(99.0) == [Alert("ended", "the run has ended")]
