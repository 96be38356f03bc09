"""Plans of the ADS against what a human then drives: disagreements, takeovers, figures."""

from __future__ import annotations

import pickle
from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from foretwin.contracts.arrays import Array
from foretwin.contracts.drive import ControlMode, PlannedTrajectory, VehicleState, VehicleStatus
from foretwin.contracts.frames import GeoPoint, LocalFrame, geo_from_local, geo_from_local_yaw
from foretwin.contracts.side_by_side import Disagreement, DrivenSegment
from foretwin.sim_worker.analysis.side_by_side.segment import DrivePlace
from foretwin.sim_worker.analysis.side_by_side.watch import HORIZON_S, SegmentsStanding, SideBySide

FRAME = LocalFrame(GeoPoint(52.5, 13.4))
START_NS = 7_000_000_000
Course = Callable[[Array], Array]
"""x, y, yaw, speed (N, 4) of a car at times (N,) of the drive."""


def straight(time_s: Array, speed_mps: float = 8.0) -> Array:
    return np.column_stack(
        [speed_mps * time_s, 0.0 * time_s, 0.0 * time_s, np.full(len(time_s), speed_mps)]
    )


def stopping(time_s: Array) -> Array:
    """8 m/s until 5 s, then 2 m/s² down to standing."""
    since = np.clip(time_s - 5.0, 0.0, 4.0)
    x = 8.0 * np.minimum(time_s, 5.0) + 8.0 * since - since**2
    return np.column_stack([x, 0.0 * x, 0.0 * x, 8.0 - 2.0 * since])


def plan_at(at_s: float, rows: Array, time_s: Array) -> PlannedTrajectory:
    geo = geo_from_local(FRAME, rows[:, :2])
    return PlannedTrajectory(
        stamp_ns=START_NS + round(at_s * 1e9),
        time_from_stamp_s=time_s,
        lat_deg=geo[:, 0].copy(),
        lon_deg=geo[:, 1].copy(),
        yaw_rad=geo_from_local_yaw(FRAME, rows[:, 2], rows[:, :2]),
        speed_mps=rows[:, 3].copy(),
    )


def state_at(at_s: float, row: Array) -> VehicleState:
    geo = geo_from_local(FRAME, row[:2])
    return VehicleState(
        vehicle_id="ego",
        stamp_ns=START_NS + round(at_s * 1e9),
        position=GeoPoint(float(geo[0]), float(geo[1])),
        yaw_rad=float(geo_from_local_yaw(FRAME, float(row[2]), row[None, :2])[0]),
        speed_mps=float(row[3]),
        yaw_rate_radps=0.0,
        accel_mps2=0.0,
    )


def side_by_side(
    driven: Course,
    planned: Callable[[float, Array], Array],
    *,
    modes: dict[float, ControlMode] | None = None,
    until_s: float = 20.0,
    killed_s: float | None = None,
    unseen_s: tuple[float, float] = (0.0, 0.0),
) -> tuple[list[Disagreement], list[DrivenSegment]]:
    """Drive a course at 10 Hz; `planned` gives the rows of the plan made at a time.

    At `killed_s` another one goes on where the first stood. Between the `unseen_s` no state comes.
    """
    here = DrivePlace(GeoPoint(0.0, 0.0))

    watch = SideBySide(FRAME, vehicle_id="ego", place=lambda: here)
    modes = {0.0: "manual"} if modes is None else modes
    ahead = np.linspace(0.0, 5.0, 51)
    found = []
    for tick in range(round(until_s * 10) + 1):
        at_s = tick / 10
        if at_s == killed_s:
            standing: SegmentsStanding = pickle.loads(pickle.dumps(watch.standing))
            assert watch.take_ended() == []
            watch = SideBySide(FRAME, vehicle_id="ego", place=lambda: here)  # noqa: B023
            watch.go_on(standing)
        if at_s in modes:
            status = VehicleStatus(stamp_ns=START_NS + round(at_s * 1e9), control_mode=modes[at_s])
            watch.take_status(status)
        state = state_at(at_s, driven(np.array([at_s]))[0])
        here = DrivePlace(state.position, "junction", 100.0 + at_s)
        watch.take_plan(plan_at(at_s, planned(at_s, ahead), ahead))
        if not unseen_s[0] < at_s < unseen_s[1]:
            found += watch.take_state(state)
    return [one for one in found + watch.finish() if one.over], watch.take_ended()


def as_driven(driven: Course) -> Callable[[float, Array], Array]:
    return lambda at_s, ahead: driven(at_s + ahead)


def drive_s(stamp_ns: int) -> float:
    return (stamp_ns - START_NS) / 1e9


def test_a_plan_that_is_driven_is_no_disagreement() -> None:
    found, (segment,) = side_by_side(stopping, as_driven(stopping))
    assert found == []
    assert segment.plans > 70
    assert segment.lateral_m == pytest.approx(0.0, abs=0.01)
    assert segment.speed_mps == pytest.approx(0.0, abs=0.05)


def test_a_plan_is_not_compared_across_a_hole_in_what_is_known_of_the_drive() -> None:
    _, (short,) = side_by_side(stopping, as_driven(stopping), unseen_s=(8.0, 9.4))
    _, (long,) = side_by_side(stopping, as_driven(stopping), unseen_s=(8.0, 9.7))
    assert short.plans - long.plans > 15
    assert long.too_short - short.too_short == short.plans - long.plans


def test_where_the_ads_goes_on_and_the_human_stops_is_told_with_its_place() -> None:
    def goes_on(at_s: float, ahead: Array) -> Array:
        rows = straight(ahead)
        rows[:, 0] += stopping(np.array([at_s]))[0, 0]
        return rows

    (found,), _ = side_by_side(stopping, goes_on)
    assert found.kind == "human_stops"
    # A plan of 4 s first departs by 2.5 m/s where 1.25 s of the braking fall into it.
    begin_s = drive_s(found.stamp_ns)
    assert begin_s == pytest.approx(5.0 + 1.25 - HORIZON_S, abs=0.5)
    assert found.speed_mps == pytest.approx(8.0, abs=0.1)
    assert found.lateral_m == pytest.approx(0.0, abs=0.01)
    assert found.junction_id == "junction"
    assert found.route_m == pytest.approx(100.0 + begin_s)
    there = geo_from_local(FRAME, stopping(np.array([begin_s]))[0, :2])
    assert found.position.lat_deg == pytest.approx(there[0], abs=1e-6)
    assert found.position.lon_deg == pytest.approx(there[1], abs=1e-6)


def test_where_the_ads_would_stop_and_the_human_goes_on() -> None:
    def brakes(at_s: float, ahead: Array) -> Array:
        rows = stopping(ahead + 5.0)
        rows[:, 0] += 8.0 * at_s - rows[0, 0]
        return rows if 6.0 <= at_s < 9.0 else straight(at_s + ahead)

    (found,), _ = side_by_side(straight, brakes)
    assert found.kind == "ads_stops"
    assert drive_s(found.stamp_ns) == pytest.approx(6.0, abs=0.2)
    assert drive_s(found.end_stamp_ns) == pytest.approx(9.0, abs=0.2)


@pytest.mark.parametrize(
    ("shift_m", "kind"),
    [(3.5, "ads_in_another_lane"), (-3.5, "ads_in_another_lane"), (1.4, "ads_beside")],
)
def test_another_lane_and_beside(shift_m: float, kind: str) -> None:
    def aside(at_s: float, ahead: Array) -> Array:
        rows = straight(at_s + ahead)
        moved = np.clip(ahead / 3.0, 0.0, 1.0)
        rows[:, 1] += shift_m * moved
        rows[:, 2] = np.arctan2(np.gradient(rows[:, 1]), np.gradient(rows[:, 0]))
        return rows if 4.0 <= at_s < 10.0 else straight(at_s + ahead)

    (found,), _ = side_by_side(straight, aside)
    assert (found.aspect, found.kind) == ("way", kind)
    assert found.lateral_m == pytest.approx(shift_m, abs=0.1)
    assert drive_s(found.end_stamp_ns) == pytest.approx(10.0, abs=0.2)


def test_an_ads_that_turns_elsewhere() -> None:
    def turns(at_s: float, ahead: Array) -> Array:
        angle = 8.0 * ahead / 12.0
        rows = straight(at_s + ahead)
        rows[:, 0] = 8.0 * at_s + 12.0 * np.sin(angle)
        rows[:, 1], rows[:, 2] = 12.0 * (1.0 - np.cos(angle)), angle
        return rows if 5.0 <= at_s < 6.0 else straight(at_s + ahead)

    found, _ = side_by_side(straight, turns)
    assert "ads_turns_elsewhere" in {one.kind for one in found if one.aspect == "way"}


def test_one_odd_plan_is_a_whim() -> None:
    def odd(at_s: float, ahead: Array) -> Array:
        rows = straight(at_s + ahead)
        rows[:, 1] += 5.0 if at_s == 6.0 else 0.0
        return rows

    found, (segment,) = side_by_side(straight, odd)
    assert found == []
    assert segment.plans > 70


def test_between_the_limits_a_disagreement_lasts() -> None:
    """1.2 m begin it; at 0.8 m it would not begin, but does not end either; 0.5 m end it."""

    def wavering(at_s: float, ahead: Array) -> Array:
        rows = straight(at_s + ahead)
        rows[:, 1] += 1.2 if at_s < 3.0 else 0.8 if at_s < 9.0 else 0.5
        return rows

    (found,), _ = side_by_side(straight, wavering)
    assert drive_s(found.end_stamp_ns) == pytest.approx(9.0, abs=0.3)


def test_no_comparison_spans_a_takeover() -> None:
    """The ADS would go on and does, from 10 s on; the human before it drives 3 m/s slower."""

    def driven(time_s: Array) -> Array:
        rows = straight(time_s, 5.0)
        later = time_s >= 10.0
        rows[later, 0] = 50.0 + 8.0 * (time_s[later] - 10.0)
        rows[later, 3] = 8.0
        return rows

    def goes_on(at_s: float, ahead: Array) -> Array:
        rows = straight(ahead)
        rows[:, 0] += driven(np.array([at_s]))[0, 0]
        return rows

    modes: dict[float, ControlMode] = {0.0: "manual", 10.0: "autonomous", 15.0: "manual"}
    found, segments = side_by_side(driven, goes_on, modes=modes)
    assert [segment.control_mode for segment in segments] == ["manual", "autonomous", "manual"]
    manual, autonomous, last = segments
    assert drive_s(manual.to_stamp_ns) == drive_s(autonomous.from_stamp_ns) == 10.0
    assert manual.speed_mps == pytest.approx(3.0, abs=0.05)
    # One plan made by hand and driven by the software would show in these.
    assert autonomous.speed_mps == pytest.approx(0.0, abs=0.05)
    assert last.speed_mps == pytest.approx(0.0, abs=0.05)
    assert manual.cut > 0
    assert manual.too_short > 0
    (one,) = found
    assert one.kind == "ads_faster"
    assert drive_s(one.end_stamp_ns) <= 10.0
    assert [segment.disagreements for segment in segments] == [1, 0, 0]


def test_who_drives_may_be_told_a_moment_after_the_first_plan() -> None:
    _, (segment,) = side_by_side(straight, as_driven(straight), modes={0.3: "manual"})
    assert segment.control_mode == "manual"
    _, segments = side_by_side(straight, as_driven(straight), modes={3.0: "manual"})
    assert [one.control_mode for one in segments] == ["unknown", "manual"]


def test_the_software_s_own_tracking_is_no_disagreement() -> None:
    def aside(at_s: float, ahead: Array) -> Array:
        rows = straight(at_s + ahead)
        rows[:, 1] += 3.0
        return rows

    for modes in ({0.0: "autonomous"}, {}):
        found, (segment,) = side_by_side(straight, aside, modes=modes)  # type: ignore[arg-type]
        assert found == []
        assert segment.lateral_m == pytest.approx(3.0, abs=0.05)


@settings(max_examples=4, deadline=None)
@given(at_s=st.integers(20, 80), shift_m=st.floats(1.1, 6.0))
def test_wherever_a_takeover_falls_both_sides_add_up(at_s: int, shift_m: float) -> None:
    def aside(_at_s: float, ahead: Array) -> Array:
        rows = straight(_at_s + ahead)
        rows[:, 1] += shift_m
        return rows

    modes: dict[float, ControlMode] = {0.0: "manual", at_s / 10: "autonomous"}
    found, segments = side_by_side(straight, aside, modes=modes, until_s=10.0)
    assert sum(s.plans + s.too_short for s in segments) in (50, 51)
    assert all(one.end_stamp_ns <= segments[1].from_stamp_ns for one in found)
    assert segments[1].disagreements == 0


def test_another_one_goes_on_with_the_segment_and_what_it_found() -> None:
    """What was planned in the last 4 s before the first one died is compared with nothing."""
    modes: dict[float, ControlMode] = {0.0: "manual", 15.0: "autonomous"}

    def beside(at_s: float, ahead: Array) -> Array:
        rows = straight(at_s + ahead)
        rows[:, 1] += 3.0 if 5.0 <= at_s < 15.0 else 0.0
        return rows

    whole, segments = side_by_side(straight, beside, modes=modes)
    found, after = side_by_side(straight, beside, modes=modes, killed_s=10.0)

    assert [(one.number, one.control_mode) for one in after] == [(0, "manual"), (1, "autonomous")]
    (uncut,) = whole
    (one, other) = found  # it ends where plans are missing, and is found again
    assert {one.kind, other.kind} == {uncut.kind}
    assert (one.stamp_ns, other.end_stamp_ns) == (uncut.stamp_ns, uncut.end_stamp_ns)
    assert drive_s(one.end_stamp_ns) < 10.0 <= drive_s(other.stamp_ns)
    before_kill, compared = after[0], segments[0]
    assert before_kill.plans + before_kill.too_short == compared.plans + compared.too_short
    assert before_kill.too_short - compared.too_short == pytest.approx(20, abs=1)
    assert before_kill.from_stamp_ns == START_NS
    assert after[1] == segments[1]
