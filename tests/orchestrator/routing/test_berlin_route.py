from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from foretwin.orchestrator.routing.arrival import DrivingPace
from foretwin.orchestrator.routing.line_matching import MatchedRoute, match_line
from foretwin.orchestrator.routing.road_index import RoadIndex
from tests.orchestrator.berlin import Drive, Replayed, berlin, replay

pytestmark = pytest.mark.real_data

END_S = 262.0
REAL_PASSAGES = (
    (39.0, {"Kronenstraße", "Markgrafenstraße"}),
    (65.0, {"Kronenstraße", "Charlottenstraße"}),
    (152.0, {"Glinkastraße", "Kronenstraße"}),
    (165.0, {"Glinkastraße", "Mohrenstraße"}),
    (248.0, {"Mohrenstraße", "Charlottenstraße"}),
)


@pytest.fixture(scope="module")
def drive(data_dir: Path) -> Drive:
    return berlin(data_dir)


@pytest.fixture(scope="module")
def route(drive: Drive) -> MatchedRoute:
    return match_line(drive.graph, drive.lat_lon_deg[: drive.until(END_S)])


@pytest.fixture(scope="module")
def predicted(drive: Drive) -> Replayed:
    return replay(drive, END_S)


def assert_five_real_junctions(replayed: Replayed) -> None:
    assert len(replayed.passed) == len(REAL_PASSAGES), [
        (time_s, passed.junction.summary.name) for time_s, passed in replayed.passed
    ]
    for (time_s, passed), (real_s, streets) in zip(replayed.passed, REAL_PASSAGES, strict=True):
        assert time_s == pytest.approx(real_s, abs=3.0)
        assert all(street in passed.junction.summary.name for street in streets)


def test_the_route_from_the_log_is_connected_and_covers_the_drive(route: MatchedRoute) -> None:
    (only,) = route.routes
    only.validate()

    assert route.near_road_share == 1.0
    assert only.end_m == pytest.approx(1400.0, rel=0.05)


def test_with_the_route_from_the_log_the_five_junctions_are_passed_once_each(
    drive: Drive, route: MatchedRoute
) -> None:
    replayed = replay(drive, END_S, route.routes)

    assert_five_real_junctions(replayed)
    assert not any(now.off_route for now in replayed.progress if now)


def test_without_a_route_the_same_five_junctions_are_passed(predicted: Replayed) -> None:
    assert_five_real_junctions(predicted)


def test_the_street_closed_to_cars_since_is_driven_and_reported(predicted: Replayed) -> None:
    assert None not in predicted.matches
    stretches = predicted.matcher.off_road_stretches

    assert [stretch.reason for stretch in stretches] == ["no_car_road", "no_car_road"]
    assert [stretch.name for stretch in stretches] == ["Kronenstraße", "Mohrenstraße"]


def test_cutting_the_log_at_120_s_changes_nothing_before(
    drive: Drive, predicted: Replayed, route: MatchedRoute
) -> None:
    cut = drive.until(120.0)

    def said(replayed: Replayed) -> list[object]:
        return [
            [p.s_m if p else None for p in replayed.progress[:cut]],
            replayed.upcoming[:cut],
        ]

    assert said(replay(drive, 120.0)) == said(predicted)
    # From the log too, as far as the next turn (215 m ahead at the cut): beyond the cut the
    # route goes on most probably, which is straight on.
    shorter = match_line(drive.graph, drive.lat_lon_deg[:cut])
    with_cut, with_all = (replay(drive, 120.0, r.routes) for r in (shorter, route))
    near = [
        [[name for name, distance_m in ahead if distance_m < 215.0] for ahead in r.upcoming]
        for r in (with_cut, with_all)
    ]
    assert near[0] == near[1]
    assert [p and p.s_m for p in with_cut.progress] == [p and p.s_m for p in with_all.progress]


def test_outside_the_map_there_is_no_match_and_inside_again_there_is(drive: Drive) -> None:
    replayed = replay(drive, 696.0)
    matched = np.array([match is not None for match in replayed.matches])
    roads = RoadIndex(drive.graph)
    away = np.array([not roads.near(xy, 40.0) for xy in drive.xy_m[: len(matched)]])
    # The match lasts for some metres after the last road; 4 s are 20 fixes.
    long_away = np.array([away[max(0, i - 20) : i + 1].all() for i in range(len(away))])

    assert long_away.sum() > 1000
    assert not matched[long_away].any()
    assert matched[: drive.until(262.0)].all()
    assert matched[drive.until(655.0) : drive.until(690.0)].all()


def test_arrivals_predicted_20_s_before_are_off_by_less_than_16_s(
    drive: Drive, route: MatchedRoute
) -> None:
    replayed = replay(drive, END_S, route.routes)
    limit_mps = 30 / 3.6
    pace = DrivingPace()
    errors = []
    for time_s, passed in replayed.passed:
        asked = drive.until(time_s - 20.0)
        for i in range(asked):
            pace.update(int(drive.time_s[i] * 1e9), float(drive.speed_mps[i]), limit_mps)
        now = replayed.progress[asked]
        assert now is not None
        (predicted_s,) = pace.seconds_to(route.routes[0], now.s_m, [passed.centre_s_m])
        errors.append(predicted_s - 20.0)

    assert np.abs(errors).max() < 16.0
    assert np.abs(errors).mean() < 9.0
