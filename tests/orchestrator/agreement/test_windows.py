"""Nominal futures against what was then driven: what a handler collects, and its verdicts."""

from __future__ import annotations

from typing import Any

import msgspec
import numpy as np
import pytest

from foretwin.contracts.drive import RoadUser, RoadUsers, SignalState
from foretwin.contracts.frames import GeoPoint, local_from_geo
from foretwin.contracts.futures import PathAhead
from foretwin.orchestrator.agreement import windows
from foretwin.orchestrator.agreement.verdict_rows import agreement_lines, judged_row
from foretwin.orchestrator.agreement.windows import MOST_KEPT, OpenWindows, judge_in
from foretwin.orchestrator.instructions import LatestReports
from foretwin.sim_worker.analysis.agreement.tally import Judged
from foretwin.sim_worker.vehicle.parameters import load_vehicle
from tests.orchestrator.futures_rounds import round_done, straight
from tests.orchestrator.trip import START_NS, states_along, town_world

COVERS = ("foretwin.orchestrator.agreement.verdict_rows",)

VEHICLE = load_vehicle()
WORLD = town_world("n4")
FROM_X, Y = -60.0, -1.6
"""Eastwards on Lime Street West, in the right-hand lane."""


def driven(
    *,
    others: bool = False,
    until_s: float = 22.0,
    std_m: float | None = 0.05,
    closed_at_s: float | None = None,
) -> OpenWindows:
    """Drive at 5 m/s for 22 s, each second with a round whose nominal future is right."""
    handler = OpenWindows(VEHICLE, horizon_s=8.0)
    handler.antenna_known = True
    line = np.array([[FROM_X, Y], [FROM_X + 5.0 * until_s, Y]])
    path = PathAhead(xy_m=line, speed_limit_mps=np.full(2, 14.0))
    for number, plain in enumerate(states_along(WORLD.frame, line, speed_mps=5.0)):
        state = msgspec.structs.replace(plain, position_std_m=std_m)
        lorry = RoadUser(
            user_id="lorry", kind="lorry", yaw_rad=0.0, speed_mps=0.0, length_m=10.0, width_m=2.5,
            position=GeoPoint(state.position.lat_deg + 5e-5, state.position.lon_deg),
        )  # fmt: skip
        seen = RoadUsers(stamp_ns=state.stamp_ns, users=(lorry,)) if others else None
        light = SignalState(stamp_ns=state.stamp_ns, group_id="g", colour="green")
        closed = number * 0.1 == closed_at_s
        handler.take(LatestReports(None, seen, (light,)), state, closed)
        if number % 10 == 0:
            ahead = straight((FROM_X + 0.5 * number, Y), speed_mps=5.0)
            done = round_done(ahead, round_id=number, stamp_ns=state.stamp_ns)
            handler.take_round(done, path, WORLD)
    handler.finish()
    return handler


def outcomes(judged: list[Judged]) -> set[str]:
    return {one.outcome for one in judged}


def test_every_second_is_judged_and_recorded() -> None:
    handler = driven()
    record = handler.record(START_NS)
    assert record is not None
    assert record["windows"] == 14  # of 22 s, those that still have 8 s before them
    assert sum(record["overall"].values()) == 14
    rows = [judged_row(one, start_stamp_ns=START_NS) for one in handler.judged]
    assert [row["drive_time_s"] for row in rows] == pytest.approx(np.arange(14.0))
    assert {row["intersection_id"] for row in rows} == {"n4"}
    assert all(row["gap_across_m"] < 0.05 and row["gap_along_m"] < 0.05 for row in rows)
    assert "clearance" not in rows[0]["observable"]  # nobody told of road users
    (line, *_) = agreement_lines(record)
    assert "driven, 14 windows: " in line
    assert agreement_lines(None) == []


def turned(gap_m: float, measured_m: float, at_s: float, *fails: str) -> dict[str, Any]:
    least = {"gap_m": gap_m, "measured_m": measured_m, "at_s": at_s, "fails": list(fails)}
    told = {f"smallest_factor_{name}": value for name, value in least.items()}
    return {"flipped": 3, "smallest_factor": round(gap_m / measured_m, 3), **told}


def test_the_least_gap_that_would_turn_a_verdict_is_told_with_its_place() -> None:
    record = {
        "windows": 44,
        "overall": {
            "agree_pass": 30,
            "agree_fail": 1,
            "too_pessimistic": 2,
            "too_optimistic": 0,
            "not_observable": 11,
        },
        "flips": {
            "along": turned(5.0, 4.0, 13.62, "drivable_area"),
            "across": {"flipped": 0},
            "both": turned(6.0, 3.0, 50.0),
        },
    }
    reached = {"id": "n4", "name": "Mill Lane \u00d7 High Street", "arrived_at_s": 20.0}
    assert agreement_lines(record, [reached]) == [
        "  simulated and driven, 44 windows: 33 can be judged, of which 31 agree (30 pass, 1 fail);"
        " in 2 the simulation was too pessimistic",
        "  least room at 13.6 s, before Mill Lane \u00d7 High Street: with a gap of 5.00 m along "
        "the road the verdict would be a fail by drivable area; 4.00 m were measured",
    ]
    record["flips"] = {"both": record["flips"]["both"]}  # type: ignore[index]
    assert agreement_lines(record, [reached])[-1].startswith(
        "  least room at 50.0 s, after Mill Lane \u00d7 High Street: with a gap of 6.00 m along "
        "and across together the verdict would be a pass; 3.00 m"
    )
    record["flips"] = {"across": turned(1.5, 6.0, 50.0, "comfort")}
    assert agreement_lines(record, [reached])[-1].endswith(
        "with 1.50 of the 6.00 m of gap that were measured across the road the verdict would "
        "be a fail by comfort"
    )


def test_who_was_seen_and_what_was_heard_counts_for_reality() -> None:
    for one in driven(others=True).judged:
        window = one.window
        assert one.verdicts.observable[0]
        assert window.driven_users.poses.shape == (81, 1, 3)
        assert window.driven_users.size_m.tolist() == [[10.0, 2.5]]
        # 5e-5 degrees to the north, always beside the car.
        aside = window.driven_users.poses[:, 0, 1] - window.driven[:, 1]
        assert aside == pytest.approx(5e-5 * 111_200.0, abs=0.05)
        assert set(window.heard["g"].colours) == {"green"}


def test_a_way_that_is_closed_to_cars_is_told_of_the_windows_that_hold_it() -> None:
    judged = driven(closed_at_s=12.0).judged
    closed = [one.window.round_id / 10 for one in judged if one.window.closed_road]
    assert closed == [4.0, 5.0, 6.0, 7.0, 8.0, 9.0, 10.0, 11.0, 12.0]


def test_how_well_a_drive_was_known_goes_with_it() -> None:
    handler = OpenWindows(VEHICLE, horizon_s=8.0)
    line = np.array([[FROM_X, Y], [FROM_X + 55.0, Y]])
    path = PathAhead(xy_m=line, speed_limit_mps=np.full(2, 14.0))
    for number, plain in enumerate(states_along(WORLD.frame, line, speed_mps=5.0)):
        std = 0.1 + 0.01 * number
        known = {"position_std_m": 0.1, "speed_std_mps": std, "yaw_std_rad": None}
        state = msgspec.structs.replace(
            plain, **(known if number % 2 else known | {"yaw_std_rad": 0.02})
        )
        handler.take(LatestReports(None, None, ()), state)
        if number == 10:
            ahead = straight((FROM_X + 5.0, Y), speed_mps=5.0)
            handler.take_round(round_done(ahead, round_id=1, stamp_ns=state.stamp_ns), path, WORLD)
    (one,) = handler.finish()
    speed_std, yaw_std = one.window.driven_std.T
    assert one.window.state_period_s == pytest.approx(0.1)
    assert not one.window.antenna_known
    assert set(np.isinf(yaw_std).tolist()) == {True, False}
    assert speed_std[0] == pytest.approx(0.2)
    assert (np.diff(speed_std) > 0.0).sum() >= 40


def test_positions_too_rough_do_not_say_whether_a_car_left_the_road() -> None:
    for std_m in (None, 3.0):
        assert not any(one.verdicts.asked[1] for one in driven(std_m=std_m).judged)


def test_a_corrected_world_changes_the_verdict_of_a_recorded_drive() -> None:
    """The map had a street where, by the corrected one, there is none."""
    judged = [one for one in driven().judged if one.outcome == "agree_pass"]
    assert len(judged) >= 5
    corrected = msgspec.structs.replace(
        WORLD,
        road_surface=(),
        junctions=tuple(msgspec.structs.replace(j, area=None) for j in WORLD.junctions),
    )
    again = judge_in(corrected, [one.window for one in judged], VEHICLE)
    assert outcomes(again) == {"agree_fail"}
    assert all(one.verdicts.driven.fails[1] for one in again)


def test_a_long_drive_keeps_no_more_windows_than_fit(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("foretwin.orchestrator.agreement.known_windows.MOST_WINDOWS", 8)
    stamps = [one.window.stamp_ns for one in driven().judged]
    assert 4 <= len(stamps) < 8
    assert set(np.diff(stamps)) == {2_000_000_000}


def test_a_desk_that_saw_nothing_says_nothing() -> None:
    handler = OpenWindows(VEHICLE, horizon_s=8.0)
    assert handler.finish() == []
    assert handler.record(0) is None


def test_of_a_crowd_the_nearest_are_kept_in_their_order() -> None:
    state = states_along(WORLD.frame, np.array([[0.0, Y], [20.0, Y]]), speed_mps=5.0)[0]
    near, far = 1e-5, 1e-3
    crowd = tuple(
        RoadUser(
            user_id=f"u{number}", kind="car", yaw_rad=0.0, speed_mps=0.0, length_m=4.0, width_m=2.0,
            position=GeoPoint(
                state.position.lat_deg + (far if number % 2 else near) * (1 + number / 1000),
                state.position.lon_deg,
            ),
        )
        for number in range(100)
    )  # fmt: skip
    seen = RoadUsers(stamp_ns=state.stamp_ns, users=crowd)
    kept = windows._nearest(seen, state)

    assert [user.user_id for user in kept.users] == [f"u{2 * k}" for k in range(MOST_KEPT)]
    few = msgspec.structs.replace(seen, users=crowd[:MOST_KEPT])
    assert windows._nearest(few, state) is few


def test_east_and_north_count_alike_for_who_is_nearest() -> None:
    state = states_along(WORLD.frame, np.array([[0.0, Y], [20.0, Y]]), speed_mps=5.0)[0]
    lat, lon = state.position.lat_deg, state.position.lon_deg
    east = [GeoPoint(lat, lon + 1.2e-5 * (1 + n)) for n in range(MOST_KEPT)]
    north = [GeoPoint(lat + 1e-5 * (1 + n), lon) for n in range(MOST_KEPT)]
    crowd = tuple(
        RoadUser(
            user_id=str(n), kind="car", yaw_rad=0.0, speed_mps=0.0, length_m=4.0, width_m=2.0,
            position=place,
        )
        for n, place in enumerate(east + north)
    )  # fmt: skip
    kept = windows._nearest(RoadUsers(stamp_ns=state.stamp_ns, users=crowd), state).users
    xy_m = [local_from_geo(WORLD.frame, u.position.lat_deg, u.position.lon_deg) for u in crowd]
    here_m = local_from_geo(WORLD.frame, lat, lon)
    away_m = np.hypot(*(np.array(xy_m) - here_m).T)

    assert {int(user.user_id) for user in kept} == set(np.argsort(away_m)[:MOST_KEPT].tolist())


def test_a_gap_that_is_next_to_none_of_what_was_measured_is_told() -> None:
    counts = ("agree_pass", "agree_fail", "too_pessimistic", "too_optimistic", "not_observable")
    nearest = turned(0.016, 40.0, 1.48, "comfort")
    record = {"windows": 0, "overall": dict.fromkeys(counts, 0), "flips": {"both": nearest}}
    assert agreement_lines(record)[-1] == (
        "  least room at 1.5 s: with 0.02 of the 40.00 m of gap that were measured along and "
        "across together the verdict would be a fail by comfort"
    )
