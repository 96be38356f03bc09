"""The mission: which Worlds are asked for, which one counts, when rounds run and when not."""

from __future__ import annotations

from typing import Literal

import msgspec
import numpy as np
import pytest

from foretwin.contracts.world import World
from foretwin.orchestrator.drive.mission import MissionSettings
from foretwin.orchestrator.instructions import NotReady, RoundIntent
from foretwin.orchestrator.routing.road_index import RoadIndex
from foretwin.orchestrator.routing.route_ahead import WayAhead
from foretwin.orchestrator.routing.speed_ahead import USUAL_BEND_MPS2
from tests.orchestrator.berlin import berlin
from tests.orchestrator.grid_map import FRAME, drive, graph_of, grid, junctions, road
from tests.orchestrator.trip import Trip, states_along, town, town_line, town_world, world_named

COVERS = ("foretwin.orchestrator.instructions",)

GRID = grid(5, 4)
CORNERS = junctions(GRID)
INDEX = RoadIndex(GRID)
ROUND_THE_BLOCK = (
    (110, 100), (200, 100), (200, 200), (100, 200), (100, 100), (200, 100), (250, 100),
)  # fmt: skip


def grid_world(junction_id: str) -> World:
    return world_named(junction_id, FRAME)


def grid_trip(**options: object) -> Trip:
    way = WayAhead(GRID, CORNERS, (), index=INDEX)
    return Trip(way, **{"world_of": grid_world, **options})  # type: ignore[arg-type]


def on_grid(*corners: tuple[float, float], start_s: float = 0.0, **state: object) -> list:
    return states_along(FRAME, drive(list(corners)), start_s=start_s, **state)  # type: ignore[arg-type]


@pytest.fixture(scope="module")
def through_town() -> Trip:
    inputs = town()
    way = WayAhead(inputs.graph, inputs.junctions, inputs.routes, index=inputs.index)
    return Trip(way, world_of=town_world).go(states_along(inputs.graph.frame, town_line()))


def test_every_world_of_a_given_route_is_there_before_the_car(through_town: Trip) -> None:
    records = [visit.record(mono_s=2000.0) for visit in through_town.mission.arrived]

    assert [(r["kind"], r["control"]) for r in records] == [
        ("t_junction", "stop"),
        ("roundabout", "roundabout"),
        ("crossing", "signals"),
        ("crossing", "give_way"),
    ]
    assert through_town.built == [(r["id"], True) for r in records]
    assert all(r["built_at_s"] < r["arrived_at_s"] for r in records)
    assert all(r["world_ready_before_s"] > 0.0 for r in records[1:])


def test_a_given_route_asks_for_no_other_turns(through_town: Trip) -> None:
    assert all(load for _, load in through_town.built)
    assert through_town.texts("warning") == []


def test_worlds_count_one_after_the_other(through_town: Trip) -> None:
    records = [visit.record(mono_s=2000.0) for visit in through_town.mission.arrived]

    assert [world for _, world in through_town.used] == [
        *(town_world(r["id"]).id for r in records), None,
    ]  # fmt: skip


def test_the_next_world_counts_from_20_m_past_a_centre() -> None:
    trip = grid_trip().go(on_grid((110, 100), (290, 100)))

    (record,) = [visit.record(mono_s=1100.0) for visit in trip.mission.arrived]
    (_, first), (switched_s, second) = trip.used
    assert (first, second) == ("world-n103", "world-n104")
    assert 10.0 * (switched_s - record["arrived_at_s"]) == pytest.approx(20.0, abs=1.1)


def test_rounds_run_in_the_world_that_counts(through_town: Trip) -> None:
    intents = [(at_s, r) for at_s, r in through_town.rounds if isinstance(r, RoundIntent)]

    for at_s, intent in intents:
        current = [world for since_s, world in through_town.used if since_s <= at_s][-1]
        assert intent.world_id == current
        assert intent.cruise_speed_mps == pytest.approx(10.0, abs=0.2)
        steps = np.hypot(*np.diff(intent.path.xy_m, axis=0).T)
        assert steps.max() < 1.1
    assert len(intents) > 100
    assert min(intent.bend_accel_mps2 for _, intent in intents) == USUAL_BEND_MPS2


def test_a_prediction_also_builds_what_other_turns_lead_to_but_loads_it_not() -> None:
    trip = grid_trip().go(on_grid((110, 100), (150, 100)))

    expected = {name for name, load in trip.built if load}
    possible = {name for name, load in trip.built if not load}
    assert {"n103", "n104"} <= expected
    assert {"n2", "n203"} <= possible
    assert not expected & possible
    # Of all that is built the workers hold the expected ones alone.
    assert set(trip.mission.worlds_ahead()) == {f"world-{name}" for name in expected}


def test_a_turn_that_comes_true_has_its_world_loaded() -> None:
    trip = grid_trip().go(on_grid((110, 100), (200, 100), (200, 180)))

    assert trip.built.index(("n203", False)) < trip.built.index(("n203", True))
    assert "world-n203" in trip.mission.worlds_ahead()


def test_off_the_map_nothing_runs_and_on_it_everything_resumes() -> None:
    trip = grid_trip()
    trip.go(on_grid((220, 100), (390, 100)))
    assert trip.mission.state == "following"
    trip.go(on_grid((390, 250), (700, 250), start_s=17.0)[20:])
    assert trip.mission.state == "off_map"
    assert trip.used[-1][1] is None
    assert trip.rounds[-1][1] is None
    assert trip.mission.next_junction is None

    trip.go(on_grid((380, 200), (220, 200), start_s=50.0))
    assert trip.mission.state == "following"
    assert isinstance(trip.rounds[-1][1], RoundIntent)
    assert len(trip.texts("warning")) == 1
    assert trip.texts("info")[-1] != trip.texts("info")[0]
    assert any(text.startswith("back on the map") for text in trip.texts("info"))


def test_before_the_map_the_mission_waits_and_complains_not() -> None:
    trip = grid_trip().go(on_grid((-900, 950), (-500, 950)))

    assert (trip.mission.state, trip.told) == ("waiting", [])


def test_a_round_without_its_world_is_late_and_says_so() -> None:
    trip = grid_trip(world_of=lambda _: None).go(on_grid((110, 100), (150, 100)))

    assert trip.rounds[-1][1] == NotReady("the world is not ready", world_late=True)


def test_a_round_without_a_heading_is_nobodys_fault() -> None:
    trip = grid_trip().go(on_grid((110, 100), (150, 100), yaw_valid=False))

    assert trip.rounds[-1][1] == NotReady("the heading is not known", world_late=False)


def test_where_the_road_ends_no_round_can_run() -> None:
    end = graph_of(
        [
            road(0, 1, 2, [(0, 0), (100, 0)]),
            road(1, 2, 3, [(100, 0), (130, 0)]),
            road(2, 2, 4, [(100, 0), (100, 100)]),
        ]
    )
    trip = Trip(WayAhead(end, junctions(end), ()), world_of=grid_world)
    trip.go(on_grid((20, 0), (109, 0)))
    assert isinstance(trip.rounds[-1][1], RoundIntent)
    trip.go(on_grid((109, 0), (116, 0), start_s=8.9))

    assert trip.mission.plan_round() == NotReady("the road ends here", world_late=False)


def test_a_world_that_cannot_be_built_is_passed_over() -> None:
    def broken(junction_id: str) -> World | Literal["failed"]:
        return "failed" if junction_id == "n103" else grid_world(junction_id)

    trip = grid_trip(world_of=broken).go(on_grid((110, 100), (250, 100)))

    assert trip.used[0][1] == "world-n104"
    assert isinstance(trip.rounds[3][1], RoundIntent)
    (record,) = (
        r
        for r in [visit.record(mono_s=1100.0) for visit in trip.mission.arrived]
        if r["id"] == "n103"
    )
    assert record["built_at_s"] is None
    assert record["world_ready_before_s"] < -80.0


def test_a_world_that_cannot_be_built_is_passed_over_the_second_time_too() -> None:
    def broken(junction_id: str) -> World | Literal["failed"]:
        return "failed" if junction_id == "n103" else grid_world(junction_id)

    trip = grid_trip(world_of=broken).go(on_grid(*ROUND_THE_BLOCK))

    assert [r["id"] for r in [visit.record(mono_s=1100.0) for visit in trip.mission.arrived]].count(
        "n103"
    ) == 2
    late = [r for _, r in trip.rounds if isinstance(r, NotReady) and r.world_late]
    assert late == []


def test_the_second_passage_of_a_junction_begins_with_its_world() -> None:
    trip = grid_trip().go(on_grid(*ROUND_THE_BLOCK))
    first, second = (
        r
        for r in [visit.record(mono_s=1100.0) for visit in trip.mission.arrived]
        if r["id"] == "n103"
    )

    assert [round(r["arrived_at_s"]) for r in (first, second)] == [9, 49]
    assert first["arrived_at_s"] <= second["built_at_s"] < second["arrived_at_s"]
    assert second["world_ready_before_s"] >= 0.0
    assert "world-n103" in [world for at_s, world in trip.used if at_s > 30.0]


def test_a_world_that_comes_after_two_passages_was_late_for_both() -> None:
    trip = grid_trip(world_of=lambda name: None if name == "n103" else grid_world(name))
    trip.go(on_grid(*ROUND_THE_BLOCK))
    trip.mission.on_world("n103", grid_world("n103"), mono_s=1060.0)
    first, second = (
        r
        for r in [visit.record(mono_s=1100.0) for visit in trip.mission.arrived]
        if r["id"] == "n103"
    )

    assert [round(r["arrived_at_s"]) for r in (first, second)] == [9, 49]
    assert first["world_ready_before_s"] < second["world_ready_before_s"] < 0.0


def test_rounds_count_for_the_junction_they_ran_for() -> None:
    trip = grid_trip().go(on_grid((110, 100), (150, 100)))
    trip.mission.on_round("n103", futures=64)
    trip.mission.on_round("n103", futures=32)
    trip.go(on_grid((150, 100), (250, 100), start_s=4.0))

    (record,) = [visit.record(mono_s=1100.0) for visit in trip.mission.arrived]
    assert (record["id"], record["rounds"], record["futures"]) == ("n103", 2, 96)


def test_worlds_further_away_than_the_look_ahead_are_not_asked_for() -> None:
    near = grid_trip(settings=MissionSettings(look_ahead_s=5.0)).go(on_grid((110, 100), (130, 100)))

    assert {name for name, load in near.built if load} == set()
    near.go(on_grid((130, 100), (180, 100), start_s=2.0))
    assert [name for name, load in near.built if load] == ["n103"]


def test_states_ten_times_a_second_are_matched_and_no_more() -> None:
    fast = on_grid((110, 100), (150, 100), rate_hz=100.0)
    trip, sparse = grid_trip().go(fast), grid_trip().go(fast[::10])

    assert trip.told == sparse.told


def test_nothing_changes_when_the_same_states_come_again() -> None:
    states = on_grid((110, 100), (200, 100), (200, 180))

    assert grid_trip().go(states).told == grid_trip().go(states).told


@pytest.mark.real_data
def test_on_the_berlin_drive_worlds_are_asked_for_long_before(data_dir) -> None:
    whole = berlin(data_dir)
    keep = whole.until(67.0)
    way = WayAhead(whole.graph, whole.junctions, ())
    trip = Trip(way, world_of=lambda name: world_named(name, whole.graph.frame))
    template = states_along(whole.graph.frame, np.array([[0.0, 0.0], [5.0, 0.0]]))[0]
    for i in range(keep):
        lat, lon = whole.lat_lon_deg[i]
        position = type(template.position)(float(lat), float(lon))
        trip.go(
            [
                msgspec.structs.replace(
                    template,
                    stamp_ns=5_000_000_000 + round(whole.time_s[i] * 1e9),
                    position=position,
                    yaw_rad=float(whole.yaw_rad[i]),
                    speed_mps=float(whole.speed_mps[i]),
                    yaw_valid=bool(whole.yaw_valid[i]),
                )
            ]
        )
    records = [visit.record(mono_s=2000.0) for visit in trip.mission.arrived]

    assert [round(r["arrived_at_s"]) for r in records][:2] == [39, 65]
    assert all(r["world_ready_before_s"] >= 10.0 for r in records[1:])
