"""Parameters in force: what counts from when, who is told, and what a hand may do."""

from __future__ import annotations

import pytest

from foretwin.contracts.tuning import Identification, ParameterEstimate, UseVehicle
from foretwin.orchestrator.runtime_configuration.handler import RefusedError
from foretwin.orchestrator.tuning.by_hand import VehicleHandler
from foretwin.orchestrator.tuning.parameter_versions import ParameterVersions, change_text
from foretwin.sim_worker.vehicle.parameters import load_vehicle

COVERS = ("foretwin.orchestrator.tuning.by_hand",)

CAR = load_vehicle()
EVERYBODY = ("mirror", "tuning", "w0")


class Told:
    """A handler, and what it told whom."""

    def __init__(self) -> None:
        self.sent: list[tuple[str, UseVehicle]] = []
        self.handler = ParameterVersions(
            CAR, vehicle_id="ego", ask=lambda who, what: self.sent.append((who, what))
        )
        self.hand = VehicleHandler(self.handler)

    @property
    def settled(self) -> bool:
        return self.handler.settled

    def hand_over(self, stamp_ns: int = 100) -> list[UseVehicle]:
        """What workers are told."""
        self.sent.clear()
        self.handler.hand_over(EVERYBODY, watcher="tuning", stamp_ns=stamp_ns)
        return [what for who, what in self.sent if who == "w0"]


def found(name: str, value: float, half: float = 0.2, reason: str = "") -> ParameterEstimate:
    return ParameterEstimate(
        name=name, value=value, low=value - half, high=value + half, reason=reason
    )


def told(*estimates: ParameterEstimate) -> Identification:
    return Identification(vehicle_id="ego", from_stamp_ns=0, stamp_ns=50, estimates=estimates)


def test_what_departs_from_the_value_in_use_counts_and_everybody_is_told_once() -> None:
    it = Told()
    it.handler.apply(told(found("steering_ratio", 15.3), found("drive_gain", 1.1)))
    assert it.settled
    (use,) = it.hand_over(100)
    assert (use.version, use.stamp_ns) == (1, 100)
    assert use.vehicle.steering_ratio.value == 15.3
    assert use.vehicle.drive_gain == CAR.drive_gain  # 1.0 lies within 0.9 to 1.3
    assert [(one.name, one.stamp_ns, one.origin) for one in use.changes] == [
        ("steering_ratio", 100, "identified")
    ]
    assert [who for who, _ in it.sent] == list(EVERYBODY)
    assert not it.settled
    for who in EVERYBODY:
        it.handler.answered(who)
    assert it.settled
    assert it.hand_over() == []


def test_an_estimate_with_a_reason_against_it_does_not_count() -> None:
    it = Told()
    it.handler.apply(told(found("steering_ratio", 15.3, reason="nearly straight")))
    assert not it.handler.waiting


def test_a_hand_sets_pins_and_rolls_back() -> None:
    it = Told()
    it.hand.check("steering_ratio", "15")
    assert it.hand.make("steering_ratio", "15", stamp_ns=10) == ("16", "15, pinned")
    (use,) = it.hand_over()
    assert (use.vehicle.steering_ratio.value, use.pinned) == (15.0, ("steering_ratio",))
    it.handler.apply(told(found("steering_ratio", 17.0)))
    assert not it.handler.waiting, "pinned"
    assert it.hand.make("steering_ratio", "rollback", stamp_ns=20) == ("15", "16, pinned")
    (use,) = it.hand_over()
    assert (use.version, use.vehicle) == (2, CAR)
    it.hand.make("steering_ratio", "unpin", stamp_ns=30)
    it.handler.apply(told(found("steering_ratio", 17.0)))
    (use,) = it.hand_over()
    assert use.vehicle.steering_ratio.value == 17.0
    origins = [change.origin for change in it.handler.made]
    assert origins == ["set", "rolled_back", "identified"]


def test_a_pin_alone_concerns_who_identifies_and_makes_no_new_version() -> None:
    it = Told()
    it.hand.make("mass_kg", "pin", stamp_ns=10)
    assert it.hand_over() == []
    assert [(who, what.version, what.pinned) for who, what in it.sent] == [
        ("tuning", 0, ("mass_kg",))
    ]


@pytest.mark.parametrize(
    ("name", "value", "text"),
    [
        ("mass_kg", "heavy", "vehicle.mass_kg=heavy: must be a number, pin, unpin or rollback"),
        ("mass_kg", "5", "vehicle.mass_kg=5: mass_kg 5 is implausible; it must be 150 to 60000"),
        (
            "mass_kg",
            "nan",
            "vehicle.mass_kg=nan: mass_kg nan is implausible; it must be 150 to 60000",
        ),
        ("mass_kg", "rollback", "mass_kg has not changed: there is nothing to roll back to"),
        (
            "wheels",
            "pin",
            r"wheels is no parameter of a vehicle; did you mean wheelbase_m\? one of",
        ),
        ("cog_from_rear_axle_m", "2.7", "must be less than wheelbase_m"),
    ],
)
def test_what_cannot_be_is_refused_in_one_line(name: str, value: str, text: str) -> None:
    it = Told()
    with pytest.raises(RefusedError, match=text):
        it.hand.check(name, value)
    assert not it.handler.waiting


def test_who_comes_up_late_is_told_what_counts_and_what_a_hand_has_set() -> None:
    it = Told()
    assert not it.handler.tell("w1")
    it.hand.make("mass_kg", "1300", stamp_ns=10)
    it.handler.apply(told(found("steering_ratio", 15.3)))
    it.hand_over(40)
    for who in EVERYBODY:
        it.handler.answered(who)
    assert it.handler.tell("w1")
    who, use = it.sent[-1]
    assert (who, use.version, use.stamp_ns) == ("w1", 1, 40)
    assert use.vehicle == it.handler.in_force.vehicle
    assert [change.name for change in use.changes] == ["mass_kg"]
    assert not it.settled


def test_a_change_reads_as_the_engineer_would_say_it() -> None:
    it = Told()
    it.handler.apply(told(found("steering_ratio", 15.3)))
    it.hand_over()
    assert (
        change_text(next(iter(it.handler.made)))
        == "steering_ratio 16 -> 15.3 ± 0.2, as the driving says"
    )
