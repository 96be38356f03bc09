"""What /foretwin/diagnostics says: the newest of each kind, and whether all goes well."""

from __future__ import annotations

import pytest

from foretwin.contracts.gap import GapAlarm, Verdict
from foretwin.contracts.simulation import Event
from foretwin.telemetry.ros2.diagnostics import DiagnosticLevels
from foretwin.telemetry.ros2.outwards import Level
from foretwin.telemetry.ros2.safety import CommandLimits, GateTrouble, VehicleGate


def gate(*, on: bool = True) -> VehicleGate:
    return VehicleGate(CommandLimits(), config_on=on, flag_on=on)


def said(*messages: Event | GapAlarm | Verdict) -> list[Level]:
    levels = DiagnosticLevels()
    for message in messages:
        levels.take(message)
    return levels.levels({}, gate=gate())[:-1]


def event(level: str, text: str) -> Event:
    return Event(stamp_ns=1, level=level, source="s", text=text)  # type: ignore[arg-type]


def alarm(quantity: str, *, over: bool) -> GapAlarm:
    return GapAlarm(
        vehicle_id="ego", stamp_ns=1, quantity=quantity, value=1.23456789, limit=0.5,
        manoeuvre="straight", over=over,
    )  # fmt: skip


def test_the_last_warning_or_error_is_told_and_what_only_informs_is_not() -> None:
    assert said(event("info", "a World is ready")) == []
    assert said(event("warning", "w0 is sick"), event("info", "it is well")) == [
        Level("foretwin/event", 1, "w0 is sick", {})
    ]
    assert said(event("warning", "w0 is sick"), event("error", "no disk")) == [
        Level("foretwin/event", 2, "no disk", {})
    ]


def test_an_alarm_stands_for_its_quantity_until_it_is_over() -> None:
    values = {"value": "1.23457", "limit": "0.5"}
    assert said(alarm("along_m", over=True), alarm("yaw_rad", over=True),
                alarm("along_m", over=False)) == [
        Level("foretwin/gap/along_m", 0, "within its limit", values),
        Level("foretwin/gap/yaw_rad", 1, "beyond its limit", values),
    ]  # fmt: skip


def test_a_verdict_is_a_warning_with_its_cause() -> None:
    verdict = Verdict(
        vehicle_id="ego", stamp_ns=2, since_stamp_ns=1, culprit="vehicle", cause="steering_gain",
        text="it steers less than it is told", evidence=(), confidence=0.9876,
    )  # fmt: skip
    assert said(verdict) == [
        Level(
            "foretwin/verdict", 1, "it steers less than it is told",
            {"cause": "steering_gain", "confidence": "0.988"},
        )
    ]  # fmt: skip


@pytest.mark.parametrize(
    ("part", "level"),
    [("in", 0), ("sent", 0), ("gate", 0), ("unused", 1), ("lost", 1), ("held", 1), ("dropped", 1)],
)
def test_counts_are_a_warning_where_there_should_be_none(part: str, level: int) -> None:
    def told(counts: dict[str, int]) -> Level:
        return DiagnosticLevels().levels({part: counts}, gate=gate())[0]

    assert told({"a": 0, "b": 3}) == Level(f"foretwin/ros2/{part}", level, "", {"a": "0", "b": "3"})
    assert told({"a": 0}).level == told({}).level == 0


def test_a_gate_that_has_shut_is_an_error_and_one_that_is_off_is_none() -> None:
    shut = gate()
    shut.heartbeat(0, now_ns=0)
    shut.shut(GateTrouble("link down", "the link is down"))
    assert DiagnosticLevels().levels({}, gate=shut) == [
        Level("foretwin/ros2/towards_vehicle", 2, "the link is down", {})
    ]
    for other in (gate(), gate(on=False)):
        (line,) = DiagnosticLevels().levels({}, gate=other)
        assert (line.level, line.text) == (0, other.why)
