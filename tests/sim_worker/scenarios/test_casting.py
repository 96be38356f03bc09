"""Casts: without anybody intervening, the planned impact happens, at its point, on the front."""

from __future__ import annotations

import math

import msgspec
import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from foretwin.contracts.scenario import ActorPart, EgoPart, Scenario
from foretwin.geometry.frenet_path import FrenetPath
from foretwin.geometry.rectangles import clearance
from foretwin.sim_worker.scenarios.casting import StagedCase, cast, cast_all
from foretwin.sim_worker.scenarios.drawing import Values, draw_cases
from foretwin.sim_worker.scenarios.places import ScenarioPlace, Unplaced
from foretwin.sim_worker.scenarios.reading import catalogue
from foretwin.sim_worker.scenarios.ways import lengthened
from foretwin.sim_worker.vehicle.parameters import load_vehicle
from tests.sim_worker.scenarios.collide import actor_boxes, ego_boxes, first_collision
from tests.sim_worker.scenarios.worlds import cross, motorway, places, race_track, ring, tee

COVERS = (
    "foretwin.sim_worker.scenarios.alongside",
    "foretwin.sim_worker.scenarios.meeting",
    "foretwin.sim_worker.scenarios.roles",
)

VEHICLE = load_vehicle()
WORLDS = {
    "cross": cross(signals=True), "left-hand cross": cross(left_hand=True, signals=True),
    "tee": tee(), "ring": ring(), "left-hand ring": ring(left_hand=True),
    "motorway": motorway(), "race track": race_track(),
}  # fmt: skip

WITHOUT_IMPACT = {"steering_fault", "gnss_offset"}
"""Nobody is met there: the ego is alone, or the other comes seconds later."""


def played(scenario: Scenario, values: Values, place: ScenarioPlace) -> StagedCase:
    found = cast(scenario, values, place, vehicle=VEHICLE)
    assert isinstance(found, StagedCase), found
    return found


def check_impact(found: StagedCase) -> None:
    """Assert that who is planned is touched first, when, where and on the front as planned."""
    hit = first_collision(found, VEHICLE, until_s=found.impact_time_s + 0.3)
    assert hit is not None
    assert hit.name == found.impact_with
    assert float(np.hypot(*(hit.point_m - found.impact_point_m))) <= 0.1
    assert hit.off_actor_m <= 0.1
    assert abs(hit.time_s - found.impact_time_s) * found.ego_speed_mps <= 0.1


@pytest.mark.parametrize("id_", list(catalogue()))
def test_the_planned_impact_happens_at_its_point(id_: str) -> None:
    scenario = catalogue()[id_]
    found = [place for world in WORLDS.values() for place in places(scenario, world, most=2).places]
    assert found
    for place in found:
        for values in draw_cases(scenario)[::2]:
            case = played(scenario, values, place)
            assert bool(case.impact_with) != (id_ in WITHOUT_IMPACT)
            if case.impact_with:
                check_impact(case)
            else:
                assert math.isnan(case.impact_time_s)


@settings(max_examples=25)
@given(
    bearings=st.tuples(st.integers(0, 10), st.integers(60, 120), st.integers(150, 210),
                       st.integers(240, 300)),
    id_=st.sampled_from(["ccftap", "cccscp", "scp", "ltap_od", "ltip", "rtip", "cpta", "cbta"]),
    ego_speed=st.floats(2.5, 15.0),
    speed=st.floats(1.0, 15.0),
    share=st.sampled_from([0.0, 0.25, 0.5, 0.75, 1.0]),
    left_hand=st.booleans(),
)  # fmt: skip
def test_impacts_happen_at_crossings_of_any_angle(
    bearings: tuple[int, ...], id_: str, ego_speed: float, speed: float, share: float,
    left_hand: bool,
) -> None:  # fmt: skip
    scenario = catalogue()[id_]
    name = scenario.actors[0].name
    world = tee(tuple(10.0 * round(bearing / 10) for bearing in bearings), left_hand=left_hand)
    found = places(scenario, world, most=1).places
    assume(found)
    values = {
        **draw_cases(scenario)[0],
        "ego.speed_mps": ego_speed,
        f"{name}.speed_mps": speed,
        f"{name}.impact_share": share,
    }
    case = cast(scenario, values, found[0], vehicle=VEHICLE)
    assume(isinstance(case, StagedCase))
    assert isinstance(case, StagedCase)
    check_impact(case)


def test_cases_are_cast_together_as_they_are_one_by_one() -> None:
    scenario = catalogue()["latency"]
    place = places(scenario, cross(), most=1).places[0]
    cases = draw_cases(scenario)
    together = cast_all(scenario, cases, place, vehicle=VEHICLE)
    for case, values in zip(together, cases, strict=True):
        alone = played(scenario, values, place)
        assert isinstance(case, StagedCase)
        assert case.values == values
        assert (case.ego_arc_m, case.impact_time_s) == (alone.ego_arc_m, alone.impact_time_s)
        assert [a.start_arc_m for a in case.actors] == [a.start_arc_m for a in alone.actors]


def test_the_ego_starts_the_lead_time_before_the_impact() -> None:
    scenario = catalogue()["scp"]
    for place in places(scenario, cross()).places:
        case = played(scenario, draw_cases(scenario)[0], place)
        assert case.impact_time_s == pytest.approx(scenario.lead_time_s)
        assert case.ego_speed_mps == case.values["ego.speed_mps"]


def test_who_arrives_later_does_not_touch() -> None:
    scenario = catalogue()["scp"]
    place = places(scenario, cross(), most=1).places[0]
    on_time = draw_cases(scenario)[0]
    late = {**on_time, "crossing_car.arrives_after_s": 3.0}
    case = played(scenario, late, place)
    assert case.impact_with == ""
    assert first_collision(case, VEHICLE, until_s=6.0) is None
    other = played(scenario, on_time, place).actors[0]
    moved = other.start_arc_m - case.actors[0].start_arc_m
    assert moved == pytest.approx(3.0 * other.speed_mps, abs=1e-6)


@pytest.mark.parametrize(
    ("late_s", "told"), [(-30.0, "before the start"), (30.0, "after the end at 8 s")]
)
def test_who_is_not_there_while_a_case_lasts_is_refused_by_name(late_s: float, told: str) -> None:
    scenario = catalogue()["scp"]
    place = places(scenario, cross(), most=1).places[0]
    values = {**draw_cases(scenario)[0], "crossing_car.arrives_after_s": late_s}
    case = cast(scenario, values, place, vehicle=VEHICLE)
    assert isinstance(case, Unplaced)
    assert case.reason.startswith(f"crossing_car, with arrives_after_s {late_s:g}, would be at ")
    assert told in case.reason


def test_who_walks_is_hidden_by_the_van_until_late() -> None:
    """The line from the ego's nose to the walker runs through the van two seconds before."""
    scenario = catalogue()["occluded_pedestrian"]
    for world in (cross(), cross(left_hand=True)):
        for place in places(scenario, world).places:
            for values in draw_cases(scenario)[1:]:
                case = played(scenario, values, place)
                walker, van = case.actors
                time = np.array([case.impact_time_s - 2.0])
                eye = ego_boxes(case, VEHICLE, time).centre_m[0]
                seen = actor_boxes(walker, time).centre_m[0]
                sight = eye + np.linspace(0.0, 1.0, 400)[:, None] * (seen - eye)
                box = actor_boxes(van, np.zeros(1))
                off = sight - box.centre_m[0]
                cos, sin = np.cos(box.yaw_rad), np.sin(box.yaw_rad)
                along, across = cos * off[:, 0] + sin * off[:, 1], cos * off[:, 1] - sin * off[:, 0]
                inside = (np.abs(along) < box.length_m / 2) & (np.abs(across) < box.width_m / 2)
                assert inside.any()
                assert walker.hidden_by == van.name


def test_nobody_parked_is_in_the_egos_way() -> None:
    for id_ in ("occluded_pedestrian", "reversing_parking"):
        scenario = catalogue()[id_]
        for place in places(scenario, cross(), most=3).places:
            case = played(scenario, draw_cases(scenario)[0], place)
            last = place.ego.exit_m if place.reverse else case.ego_arc_m + 60.0
            time = np.arange(0.0, (last - case.ego_arc_m) / case.ego_speed_mps, 0.01)
            ego = ego_boxes(case, VEHICLE, time)
            for actor in case.actors:
                if actor.conduct == "parked":
                    assert actor.speed_mps == 0.0
                    assert float(clearance(ego, actor_boxes(actor, time)).min()) > 0.15


def test_gaps_run_from_bumper_to_bumper() -> None:
    scenario = catalogue()["overtaking_motorway"]
    place = places(scenario, motorway(), most=1).places[0]
    case = played(scenario, draw_cases(scenario)[0], place)
    ego = ego_boxes(case, VEHICLE, np.zeros(1))
    lorry, fast = (actor_boxes(actor, np.zeros(1)) for actor in case.actors)
    ahead = float(np.hypot(*(lorry.centre_m - ego.centre_m)[0]))
    assert ahead - (lorry.length_m + ego.length_m) / 2 == pytest.approx(40.0, abs=0.1)
    # To the across side: to the left where traffic keeps right.
    heading = ego.yaw_rad[0]
    aside = float((fast.centre_m - ego.centre_m)[0] @ [-math.sin(heading), math.cos(heading)])
    assert aside == pytest.approx(3.75, abs=0.1)


def test_paths_hold_everybodys_start() -> None:
    """Who builds a path of `xy_m` finds all starts on it, without prolonging it backwards."""
    for id_, scenario in catalogue().items():
        values = draw_cases(scenario)[0]
        for world in WORLDS.values():
            for place in places(scenario, world, cases=[values], most=1).places:
                case = played(scenario, values, place)
                assert case.ego_arc_m >= 0.0, id_
                for actor in case.actors:
                    assert 0.0 <= actor.start_arc_m <= FrenetPath(actor.xy_m).length_m + 100.0, id_


def test_somebody_off_the_road_is_refused() -> None:
    scenario = Scenario(
        id="x", title="x", shows="x.", source="x", ego=EgoPart(speed_mps=8.0),
        actors=(ActorPart(name="van", relation="parked", conduct="parked", lateral_m=-40.0),),
    )  # fmt: skip
    (unplaced,) = places(scenario, cross()).unplaced
    assert unplaced.applies
    assert "van would be 40.0 m beside the ego's path, off the road" in unplaced.reason


def test_an_impact_after_the_end_is_refused() -> None:
    scenario = catalogue()["scp"]
    place = places(scenario, cross(), most=1).places[0]
    values = {**draw_cases(scenario)[0], "ego.speed_mps": 5.0}
    far = cast(scenario, values, place, vehicle=VEHICLE, ego_arc_m=0.0)
    assert isinstance(far, Unplaced)
    assert "after the end at 8 s" in far.reason


def test_a_standing_car_is_taken_to_set_off() -> None:
    scenario = catalogue()["scp"]
    place = places(scenario, cross(), most=1).places[0]
    values = {**draw_cases(scenario)[0], "ego.speed_mps": 0.0}
    near = cast(scenario, values, place, vehicle=VEHICLE, ego_arc_m=place.ego.entry_m - 8.0)
    assert isinstance(near, StagedCase)
    assert near.ego_speed_mps == 2.0
    check_impact(near)


def test_the_same_values_give_the_same_cast() -> None:
    scenario = catalogue()["ltap_od"]
    values = draw_cases(scenario)[1]
    runs = [played(scenario, values, places(scenario, cross(), most=1).places[0]) for _ in range(2)]
    assert msgspec.json.encode(runs[0].actors[0].xy_m.tolist()) == msgspec.json.encode(
        runs[1].actors[0].xy_m.tolist()
    )
    assert runs[0].ego_arc_m == runs[1].ego_arc_m
    assert [a.start_arc_m for a in runs[0].actors] == [a.start_arc_m for a in runs[1].actors]


def test_nobody_begins_in_a_bend_too_tight_for_its_speed() -> None:
    scenario, world = catalogue()["scp"], cross()
    place = places(scenario, world, most=1).places[0]
    bend_m, entry_m, radius_m = 30.0, place.ego.entry_m, 10.0
    after = place.ego.path.pose_at(np.arange(entry_m - bend_m, place.ego.exit_m + 60.0, 1.0))
    heading = float(after.yaw_rad[0])
    turn = np.linspace(np.pi / 2.0, 0.05, 24)
    back = radius_m * np.stack([-np.sin(turn), 1.0 - np.cos(turn)], axis=-1)
    cos, sin = math.cos(heading), math.sin(heading)
    bend = after.xy_m[0] + back @ np.array([[cos, sin], [-sin, cos]])
    xy = np.concatenate([bend, after.xy_m])
    length_m = float(np.hypot(*np.diff(bend, axis=0).T).sum())
    way = lengthened(
        "bent", xy, np.full(len(xy), 13.9), length_m + bend_m,
        length_m + bend_m + place.ego.exit_m - entry_m,
    )  # fmt: skip
    bent = place._replace(ego=way)
    case = draw_cases(scenario)[0]
    fast = played(scenario, case | {"ego.speed_mps": 12.0}, bent)
    curvature = way.path.at_nodes(way.path.curvature_pm, np.array([fast.ego_arc_m]))
    assert abs(float(curvature[0])) * 12.0**2 <= 4.0
    assert 1.6 <= fast.impact_time_s < 3.5
    check_impact(fast)
    slow = played(scenario, case | {"ego.speed_mps": 6.0}, bent)
    assert slow.impact_time_s == pytest.approx(scenario.lead_time_s)
