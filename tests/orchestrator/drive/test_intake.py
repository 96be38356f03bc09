"""Where telemetry comes in: every sample is counted, and some give a new state."""

from __future__ import annotations

from types import SimpleNamespace

import msgspec
import numpy as np
import pytest

from foretwin.contracts.codec import SchemaMismatch, encode
from foretwin.contracts.drive import (
    DriveEnd,
    GnssFix,
    PlannedTrajectory,
    SignalColour,
    SignalState,
    VehicleStatus,
)
from foretwin.contracts.frames import GeoPoint
from foretwin.contracts.guard import Refused
from foretwin.contracts.mailbox import Mailbox, Received
from foretwin.orchestrator.drive.intake import Intake
from foretwin.orchestrator.drive.telemetry_watch import (
    TelemetryWatch,
    estimate_line,
    estimate_object,
)
from foretwin.telemetry.estimator.innovations import Surprises
from foretwin.telemetry.estimator.mounting import Learnt, Mounting
from foretwin.telemetry.estimator.reported_state import StateConsistency
from foretwin.telemetry.estimator.told_spreads import Stretched
from tests.contracts.memory_bus import MemoryBus
from tests.orchestrator.house import INFO
from tests.orchestrator.trip import START_NS, states_along, town
from tests.telemetry.winding_drive import driven

COVERS = ("foretwin.orchestrator.drive.telemetry_watch",)

STATES = states_along(town().graph.frame, np.array([[0.0, 0.0], [50.0, 0.0]]))
FIXES = [GnssFix(stamp_ns=s.stamp_ns, position=s.position) for s in STATES]


class Telemetry:
    """A bus with one vehicle on it, and an intake that has taken what it sent."""

    def __init__(self, *, introduced: bool = True) -> None:
        self.bus, self.mailbox = MemoryBus(), Mailbox(256)
        for channel in ("gnss", "plan", "status", "end"):
            self.bus.subscribe(channel, self.mailbox, vehicle="ego")
        self.intake = Intake(town().vehicle)
        if introduced:
            self.intake.take_info(INFO)

    def send(self, *messages: object) -> list[object]:
        names = {
            GnssFix: "gnss",
            PlannedTrajectory: "plan",
            VehicleStatus: "status",
            DriveEnd: "end",
        }
        for message in messages:
            self.bus.publish(names[type(message)], message, vehicle="ego")  # type: ignore[arg-type]
        taken = []
        while (item := self.mailbox.take()) is not None:
            taken.append(self.intake.take(item))  # type: ignore[arg-type]
        return taken


def test_positions_give_states_with_the_time_of_their_receipt() -> None:
    telemetry = Telemetry()
    states = telemetry.send(*FIXES)

    assert all(state is not None for state in states)
    intake = telemetry.intake
    assert intake.states == intake.counts.received == len(FIXES)
    assert intake.latest is not None
    assert intake.latest.state is states[-1]
    assert intake.latest.receipt_mono_ns > 0
    assert intake.now_stamp_ns == STATES[-1].stamp_ns
    assert states[-1].speed_mps == pytest.approx(10.0, abs=0.1)  # type: ignore[attr-defined]
    assert (intake.start_stamp_ns, intake.first_stamp_ns) == (START_NS, START_NS)


def test_before_the_car_has_said_what_it_is_samples_are_counted_alone() -> None:
    telemetry = Telemetry(introduced=False)

    assert telemetry.send(*FIXES[:3]) == [None, None, None]
    assert telemetry.intake.counts.received == 3
    assert telemetry.intake.latest is None
    assert telemetry.intake.now_stamp_ns == 0
    assert telemetry.intake.next_stamp_ns == 0, "no stamp: who shows it would count from there"
    telemetry.intake.take_info(INFO)
    assert telemetry.intake.next_stamp_ns == START_NS + 1
    assert telemetry.send(FIXES[3])[0] is not None


def test_a_plan_is_kept_and_gives_no_state() -> None:
    telemetry = Telemetry()
    one = np.ones(2)
    plan = PlannedTrajectory(
        stamp_ns=START_NS, time_from_stamp_s=np.arange(2.0), lat_deg=one, lon_deg=one,
        yaw_rad=one, speed_mps=one,
    )  # fmt: skip

    assert telemetry.send(plan) == [None]
    assert telemetry.intake.plan is not None
    assert telemetry.intake.plan.stamp_ns == START_NS


def test_a_state_says_who_drives() -> None:
    telemetry = Telemetry()
    before, *_ = telemetry.send(FIXES[0])
    assert before.control_mode == "unknown"  # type: ignore[attr-defined]
    telemetry.send(VehicleStatus(stamp_ns=FIXES[1].stamp_ns, control_mode="manual"))
    after, *_ = telemetry.send(FIXES[1])
    assert after.control_mode == "manual"  # type: ignore[attr-defined]


def test_what_was_refused_is_summed_over_all_who_refuse() -> None:
    telemetry = Telemetry()
    telemetry.send(*FIXES[:5], FIXES[0])  # the last one's clock runs backwards
    foreign = bytearray(encode(FIXES[5]))
    foreign[4] = 99
    telemetry.mailbox.put(Received("gnss", "…/gnss", bytes(foreign), GnssFix))
    with pytest.raises(SchemaMismatch):
        telemetry.send()
    telemetry.send(DriveEnd(stamp_ns=START_NS, published={"gnss": 6}, skipped_invalid=3))

    assert telemetry.intake.refused == 1
    assert telemetry.intake.skipped_invalid == 1 + 1 + 3
    assert telemetry.intake.counts.received == 6  # the end is no sample


def test_a_sample_that_was_refused_is_not_lost_as_well() -> None:
    telemetry = Telemetry()
    telemetry.send(*FIXES[:2])
    nowhere = msgspec.structs.replace(FIXES[2], position=GeoPoint(float("nan"), 0.0))
    with pytest.raises(Refused):
        telemetry.send(nowhere)
    telemetry.send(*FIXES[3:5])
    telemetry.intake.counts.settle({"gnss": 5})

    assert (telemetry.intake.refused, telemetry.intake.counts.lost) == (1, 0)
    assert telemetry.intake.counts.received == 4


def test_an_age_is_never_negative() -> None:
    telemetry = Telemetry()
    telemetry.send(*FIXES)

    assert (telemetry.intake.counts.ages_ms.percentile(0) or 0.0) >= 0.0
    assert (telemetry.intake.counts.ages_ms.percentile(100) or 0.0) < 60_000.0


def heard(intake: Intake, sample: GnssFix, mono_ns: int) -> list[str]:
    """Return what is warned of after `sample` came at `mono_ns`."""
    item = Received("gnss", "…/gnss", encode(sample), GnssFix)
    item.received_mono_ns = mono_ns
    intake.take(item)
    return intake.warnings(mono_ns)


def test_lights_that_were_heard_by_a_clock_that_has_stepped_count_no_more() -> None:
    """A clock that is set back by an hour must not cost the lights of that hour."""
    intake = Intake(town().vehicle, pace=1.0)
    intake.take_info(INFO)
    step_ns = 3600 * 10**9
    later = [msgspec.structs.replace(fix, stamp_ns=fix.stamp_ns - step_ns) for fix in FIXES]
    span_ns = FIXES[-1].stamp_ns - FIXES[0].stamp_ns + 10**8
    for fix in (*FIXES, *later):
        mono_ns = 10**9 + fix.stamp_ns - START_NS
        heard(intake, fix, mono_ns if fix in FIXES else mono_ns + step_ns + span_ns)
        colour: SignalColour = "green" if fix in FIXES else "red"
        light = SignalState(stamp_ns=fix.stamp_ns, group_id="1", colour=colour)
        intake.take(Received("signals", "…/signals", encode(light), SignalState))

    assert intake.estimator is not None
    assert intake.estimator.clock_steps == 1
    newest = SignalState(stamp_ns=later[-1].stamp_ns, group_id="1", colour="red")
    assert intake.surroundings.signals == (newest,)


def test_a_live_vehicles_clock_is_recorded_and_its_silence_told_once() -> None:
    intake = Intake(town().vehicle, pace=1.0)
    intake.take_info(INFO)
    mono_ns = [1_000_000_000 + fix.stamp_ns - START_NS for fix in FIXES]
    for fix, at_ns in zip(FIXES, mono_ns, strict=True):
        assert heard(intake, fix, at_ns) == []
    heard(intake, FIXES[-1], mono_ns[-1])
    record = intake.record()
    assert record["doubled"] == 1
    assert record["late"] == 0
    assert record["clock_drift_ppm"] == 0.0
    assert record["clock_steps_s"] == []

    told = [t for k in range(40) for t in intake.warnings(mono_ns[-1] + k * 50_000_000)]
    assert told == ["telemetry overdue: gnss; states go on without"]
    assert intake.record()["stale"] == {"gnss": 1}


def test_a_clock_that_steps_back_is_told_once() -> None:
    intake = Intake(town().vehicle, pace=1.0)
    intake.take_info(INFO)
    said = []
    for k, fix in enumerate(FIXES):
        back_ns = 3600 * 10**9 if k >= len(FIXES) // 2 else 0
        moved = GnssFix(stamp_ns=fix.stamp_ns - back_ns, position=fix.position)
        said += heard(intake, moved, 1_000_000_000 + fix.stamp_ns - START_NS)
    assert len([text for text in said if "clock stepped by -3600.000 s" in text]) == 1
    assert intake.latest is not None
    assert intake.latest.state.stamp_ns == FIXES[-1].stamp_ns - 3600 * 10**9
    assert intake.record()["clock_steps_s"] == [-3600.0]


def test_in_lock_step_times_of_receipt_mean_nothing() -> None:
    telemetry = Telemetry()
    telemetry.send(*FIXES)
    record = telemetry.intake.record()
    assert record["clock_offset_ms"] is None
    assert record["late"] == record["doubled"] == 0


def test_what_is_said_of_trust_is_of_plain_numbers() -> None:
    """A record is told while a drive goes on: numbers of numpy's would end it."""
    imu = Surprises(taken=4, within=np.float64(3.0))
    stretched = Stretched(np.float64(1.0), np.float64(0.5), np.float64(2.0))
    learnt = Mounting(*(Learnt(np.float64(1.0), np.float64(0.1), True) for _ in range(3)), turns=1)
    found = StateConsistency({"imu": imu}, np.float64(1.5), stretched, np.float64(0.02), 0, learnt)
    said = msgspec.json.decode(msgspec.json.encode(estimate_object(found)))
    assert said["within_95"] == {"imu": {"share": 0.75, "count": 4}}
    assert (said["spreads_widened"], said["position_noise_m"]) == (1.5, 0.02)
    assert said["spreads_stretched"] == {"place": 1.0, "speed": 0.5, "yaw": 2.0}
    assert said["antenna_forward_m"] == said["fixes_late_s"] == {"value": 1.0, "std": 0.1}


def test_a_run_says_how_far_its_states_can_be_trusted() -> None:
    telemetry = Telemetry()
    assert telemetry.intake.record()["estimate"]["within_95"] == {}
    telemetry.send(*FIXES)
    record = telemetry.intake.record()
    estimate = record["estimate"]
    assert estimate["within_95"]["gnss"]["count"] > 0
    assert 0.0 <= estimate["within_95"]["gnss"]["share"] <= 1.0
    assert estimate["spreads_widened"] == 1.0
    assert estimate["receiver_slips"] == 0
    assert 0.0 < record["speed_std_mps"] < 2.0
    assert 0.0 < record["yaw_std_rad"] < 1.0


def test_messages_of_another_type_are_told_once_and_other_faults_are_not_taken_for_them() -> None:
    watch = TelemetryWatch()
    estimator = SimpleNamespace(clock_steps=0, left_out=frozenset(), refused=["speed_wrong_type"])
    told = watch.estimator(estimator)  # type: ignore[arg-type]
    assert told == ["telemetry: speed carries messages of another type; refused"]
    estimator.refused += ["gnss_out_of_bounds"]
    assert watch.estimator(estimator) == []  # type: ignore[arg-type]


def test_the_summary_says_how_far_states_can_be_trusted() -> None:
    unknown = Learnt(0.0, 1.0, observable=False)
    surprises = {"gnss": Surprises(taken=200, within=190.0)}
    plain = Stretched(1.0, 1.0, 1.0)
    mounting = Mounting(unknown, unknown, unknown, turns=0)
    little = StateConsistency(surprises, 1.0, plain, 0.02, 0, mounting)
    assert estimate_line(little) == (
        "estimate: within its 95 %: gnss 95 %; fixes taken for good to 0.02 m"
    )
    late = mounting._replace(
        antenna_forward_m=Learnt(1.5, 0.1, observable=True),
        fixes_late_s=Learnt(0.2, 0.01, observable=True),
    )
    much = StateConsistency(surprises, 1.5, plain, None, 3, late)
    assert estimate_line(much) == (
        "estimate: within its 95 %: gnss 95 %; the receiver slipped 3 times; antenna 1.50 ± 0.20 m "
        "ahead of the axle; fixes 200 ± 20 ms late; spreads widened by 1.5"
    )


def test_a_sensor_that_does_not_go_with_positions_is_told_once() -> None:
    estimator, _ = driven(gyro=lambda rate: -rate, wheels=lambda speed: 3.6 * speed)
    watch = TelemetryWatch()
    imu, speed = watch.estimator(estimator)
    assert imu.startswith("telemetry: imu does not go with positions")
    assert "is it in m/s" in speed
    assert watch.estimator(estimator) == []
    assert TelemetryWatch().estimator(driven()[0]) == []
