"""Whether cases fit their roads: who crosses whom, and which speeds a limit bears."""

from __future__ import annotations

import msgspec
import numpy as np
import pytest

from foretwin.contracts.scenario import ActorPart, EgoPart, Relation, TrafficTurn
from foretwin.sim_worker.futures.playable import places
from foretwin.sim_worker.scenarios.drawing import draw_cases
from foretwin.sim_worker.scenarios.fitting import crosses, not_for, unfit
from foretwin.sim_worker.scenarios.reading import catalogue
from foretwin.sim_worker.scenarios.roles import StagedCase
from tests.sim_worker.scenarios.worlds import cross


@pytest.mark.parametrize(
    ("ego", "relation", "turn", "expected"),
    [
        ("straight", "from_near", "straight", True),
        ("across", "oncoming", "straight", True),
        ("straight", "oncoming", "across", True),
        ("across", "from_near", "straight", False),  # Both leave by the far side.
        ("near", "from_across", "straight", False),
        ("straight", "from_near", "near", False),
        ("straight", "ahead", "straight", False),
    ],
)
def test_whose_ways_lead_to_one_arm_merge(
    ego: TrafficTurn, relation: Relation, turn: TrafficTurn, expected: bool
) -> None:
    assert crosses(EgoPart(turn=ego), ActorPart(name="x", relation=relation, turn=turn)) == expected


def staged(id_: str) -> StagedCase:
    found = places(catalogue()[id_], cross(), most=1).cases[0][0]
    assert isinstance(found, StagedCase)
    return found


def test_who_comes_to_the_egos_own_arm_does_not_cross_it() -> None:
    scenario, case = catalogue()["ccftap"], staged("ccftap")
    assert unfit(scenario, case) == ""
    way = case.place.actor_ways[0][0]
    ego = case.place.ego
    # The other's way, bent so that it ends on the ego's.
    xy = np.concatenate([way.path.point_at(np.arange(0.0, way.entry_m)), ego.xy_m[-20:]])
    merges = way._replace(xy_m=xy, path=type(way.path)(xy), exit_m=way.entry_m + 60.0)
    place = case.place._replace(actor_ways=((merges,),))
    reason = unfit(scenario, case._replace(place=place))
    assert reason in (
        "oncoming_car does not cross the ego's way: the two merge",
        "oncoming_car would meet the ego along its way, not across it",
    )


def test_straight_crossing_paths_are_about_square() -> None:
    """Turned by 60° where it meets the ego, a car still crosses; by 30° it comes along the road."""
    scenario, case = catalogue()["scp"], staged("scp")
    way, ego = case.place.actor_ways[0][0], case.place.ego
    met = ego.path.point_at(np.array([case.ego_arc_m + case.ego_speed_mps * case.impact_time_s]))
    own = float(ego.path.pose_at(np.array([case.ego_arc_m])).yaw_rad[0])
    for turned_deg, fits in ((-60.0, True), (-120.0, True), (-30.0, False), (-150.0, False)):
        yaw = own + np.radians(turned_deg)
        arcs = np.arange(-150.0, 120.0, 5.0)[:, None]
        line = met + arcs * np.array([np.cos(yaw), np.sin(yaw)])
        path = type(way.path)(line)
        actor = case.actors[0]
        start = 150.0 - actor.speed_mps * case.impact_time_s
        moved = way._replace(xy_m=line, path=path, entry_m=140.0, exit_m=160.0)
        place = case.place._replace(actor_ways=((moved,),))
        turned = actor._replace(xy_m=line, start_arc_m=start)
        reason = unfit(scenario, case._replace(place=place, actors=(turned,)))
        assert (reason == "") == fits, (turned_deg, reason)


def test_short_run_ups_and_roads_that_end_are_told() -> None:
    scenario, case = catalogue()["scp"], staged("scp")
    assert "less than 2.5 s" in unfit(scenario, case._replace(impact_time_s=2.0))
    assert "too short" in unfit(scenario, case._replace(off_lanes_m=5.0))


def test_limits_bear_the_egos_speed_and_more_of_others() -> None:
    scenario = catalogue()["cccscp"]
    place = staged("cccscp").place
    limit = 50 / 3.6
    values = draw_cases(scenario)[0]
    for name, factor, fits in (
        ("ego.speed_mps", 1.09, True),
        ("ego.speed_mps", 1.11, False),
        ("crossing_car.speed_mps", 1.49, True),
        ("crossing_car.speed_mps", 1.51, False),
    ):
        assert (not_for(scenario, {**values, name: factor * limit}, place) == "") == fits


def test_nobody_walks_or_parks_on_a_motorway() -> None:
    scenario = catalogue()["occluded_pedestrian"]
    place = staged("occluded_pedestrian").place._replace(road_classes=("motorway", "primary"))
    values = draw_cases(scenario)[0]
    assert not_for(scenario, values, place) == "walker would be on a motorway"
    cars = msgspec.structs.replace(scenario, actors=())
    assert not_for(cars, values, place._replace(actor_ways=())) == ""
