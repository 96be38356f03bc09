"""Placing: who comes from where, on either side of the road, and why some junctions have none."""

from __future__ import annotations

import math

import msgspec
import numpy as np
import pytest
import shapely

from foretwin.contracts.frames import wrap_angle
from foretwin.contracts.scenario import (
    ActorPart,
    EgoPart,
    Relation,
    Scenario,
    TrafficTurn,
    Where,
)
from foretwin.contracts.world import World
from foretwin.geometry.frenet_path import FrenetPath
from foretwin.sim_worker.scenarios.casting import StagedCase, cast
from foretwin.sim_worker.scenarios.drawing import draw_cases
from foretwin.sim_worker.scenarios.placement import PassageFinder, places_on_passage
from foretwin.sim_worker.scenarios.places import ScenarioPlace, Unplaced
from foretwin.sim_worker.scenarios.reading import catalogue
from foretwin.sim_worker.scenarios.relations import ways_of
from foretwin.sim_worker.scenarios.roads import RoadNetwork
from foretwin.sim_worker.scenarios.ways import unlike_its_turn
from foretwin.sim_worker.vehicle.parameters import load_vehicle
from foretwin.world_gen.build import build_region
from foretwin.world_gen.roads.build_graph import build_road_graph
from tests.sim_worker.places import box
from tests.sim_worker.scenarios.worlds import cross, motorway, places, race_track, ring, tee
from tests.world_gen.drawn_maps import CROSS, STREET, drawn_map, world_of

COVERS = (
    "foretwin.sim_worker.scenarios.beyond_junctions",
    "foretwin.sim_worker.scenarios.places",
    "foretwin.sim_worker.scenarios.relations",
    "foretwin.sim_worker.scenarios.walls",
)

VEHICLE = load_vehicle()


def placed(id_: str, world: World) -> tuple[ScenarioPlace, ...]:
    result = places(catalogue()[id_], world)
    assert not result.unplaced, result.unplaced
    return result.places


def why_not(id_: str, world: World) -> Unplaced:
    result = places(catalogue()[id_], world)
    assert not result.places
    return result.unplaced[0]


def relative_heading_deg(place: ScenarioPlace, *, at_m: float = 20.0) -> float:
    """Return how far the first actor's heading is turned left of the ego's, before the junction."""
    ego, way = place.ego, place.actor_ways[0][0]
    own = ego.path.pose_at(np.array([ego.entry_m - at_m])).yaw_rad
    other = way.path.pose_at(np.array([way.entry_m - at_m])).yaw_rad
    return math.degrees(float(wrap_angle(other - own)[0]))


@pytest.mark.parametrize(
    ("id_", "angle_deg"),
    [("ccftap", 180.0), ("ltap_od", 180.0), ("cccscp", 90.0), ("scp", -90.0), ("ltip", 90.0),
     ("rtip", -90.0), ("emergency_vehicle", 90.0)],
)  # fmt: skip
@pytest.mark.parametrize("left_hand", [False, True])
def test_others_come_from_where_the_relation_says(
    id_: str, angle_deg: float, left_hand: bool
) -> None:
    """Who comes from the near side, the right one where traffic keeps right, heads left."""
    found = placed(id_, cross(left_hand=left_hand))
    assert len(found) == 4
    for place in found:
        wanted = -angle_deg if left_hand else angle_deg
        off = float(wrap_angle(math.radians(relative_heading_deg(place) - wanted)))
        assert abs(off) < math.radians(5.0)


def test_a_t_junction_takes_what_its_arms_allow() -> None:
    """Arms to the east, west and south: one way to turn across oncoming traffic, none to cross."""
    world = tee()
    assert len(placed("ccftap", world)) == 1
    assert len(placed("rtip", world)) == 1
    assert why_not("scp", world) == (world.intersection.id, "its kind is t_junction", False)
    crossing = catalogue()["scp"]
    anywhere = Scenario(
        id="x", title="x", shows="x.", source="x", ego=crossing.ego, actors=crossing.actors
    )
    result = places(anywhere, world)
    reason = "nobody can come from across straight on and meet the ego's path"
    assert result.unplaced == ((world.intersection.id, reason, False),)


def test_controls_and_turns_are_asked_for() -> None:
    assert why_not("red_light", cross()).reason == "its control is uncontrolled"
    assert len(placed("red_light", cross(signals=True))) == 4
    assert why_not("roundabout_entry", cross()).reason == "its kind is crossing"


@pytest.mark.parametrize("left_hand", [False, True])
def test_who_is_on_the_ring_comes_round_to_the_egos_entry(left_hand: bool) -> None:
    for place in placed("roundabout_entry", ring(left_hand=left_hand)):
        way = place.actor_ways[0][0]
        radius = np.hypot(*way.path.point_at(np.arange(way.first_m, way.last_m)).T)
        assert radius.max() < 20.0


def test_people_cross_the_arm_that_the_ego_leaves_or_enters_by() -> None:
    for id_, mouth in (("cpta", "exit_m"), ("occluded_pedestrian", "entry_m")):
        for place in placed(id_, cross()):
            way = place.actor_ways[0][0]
            middle = way.path.point_at(np.array([(way.entry_m + way.exit_m) / 2]))
            at = float(place.ego.path.locate(middle).arc_m[0])
            beyond = at - getattr(place.ego, mouth)
            assert 0.0 < (beyond if mouth == "exit_m" else -beyond) < 10.0


def test_the_first_other_names_the_place_with_the_ego() -> None:
    place = placed("scp", cross())[0]
    connections = RoadNetwork(cross()).connections
    assert all(part in connections for part in place.name.split("/"))


def test_a_motorway_takes_overtaking_on_its_slow_lane() -> None:
    world = motorway()
    found = placed("overtaking_motorway", world)
    roads = RoadNetwork(world)
    for place in found:
        lane = roads.lanes[place.name]
        assert lane.left_id is not None
        assert lane.right_id is None
    assert "motorway" in why_not("overtaking_motorway", cross()).reason
    bent = {i: (x, 0.0) for i, x in enumerate((-300.0, -150.0, -8.0), start=1)}
    bent |= {4: (-2.0, 2.0), 5: (0.0, 8.0), 6: (0.0, 150.0), 7: (0.0, 300.0)}
    tags = {"highway": "trunk", "lanes": "2", "oneway": "yes", "maxspeed": "100"}
    osm = drawn_map(bent, [(1, list(bent), tags)])
    corner = build_region(osm, build_road_graph(osm), osm.bounds)
    assert why_not("overtaking_motorway", corner).reason.endswith("has a bend tighter than 150 m")


def test_a_closed_track_is_one_lap_and_more() -> None:
    (place,) = placed("race_track_lap", race_track())
    assert place.name.startswith("lap from ")
    # 4 · 45 + … of a stadium: both straights of 180 m, both half circles of 60 m radius, twice.
    assert place.ego.last_m - place.ego.first_m == pytest.approx(2 * 736.0, abs=15.0)
    assert why_not("race_track_lap", cross()).reason == "no race track in the World"


def test_bays_lie_at_the_near_side_of_the_road() -> None:
    for left_hand in (False, True):
        for place in placed("reversing_parking", cross(left_hand=left_hand)):
            assert place.reverse
            path = place.ego.path
            start, end = path.pose_at(np.array([0.0, place.ego.exit_m])).xy_m
            backwards = path.pose_at(np.array([0.0])).yaw_rad[0]
            # Seen by a driver who backs, the near side lies on the other hand.
            left = np.array([-math.sin(backwards), math.cos(backwards)])
            aside = float((end - start) @ left)
            assert (aside > 0.0) == (not left_hand)
            assert 2.0 < abs(aside) < 3.5


def test_nobody_parks_where_one_who_backs_into_a_bay_would_touch_it() -> None:
    scenario = catalogue()["reversing_parking"]
    tight = tuple(
        msgspec.structs.replace(part, gap_m=1.5) if part.name == "car_ahead" else part
        for part in scenario.actors
    )
    result = places(msgspec.structs.replace(scenario, actors=tight), cross())
    assert result.unplaced[0].reason == "car_ahead would stand in the ego's way"


def test_who_cannot_come_through_a_house_comes_along_the_road() -> None:
    scenario = catalogue()["cbta"]
    open_ground = places(scenario, cross(), most=1).places[0]
    (way,) = open_ground.actor_ways[0]
    x, y = way.path.point_at(np.array([way.entry_m - 12.0]))[0]
    built = msgspec.structs.replace(cross(), buildings=(box(x, y, 6.0, 6.0),))
    found = places(scenario, built).places
    names = [place.name for place in found]
    assert open_ground.name not in names
    assert f"{open_ground.name}, along the road" in names
    house = shapely.box(x - 6.0, y - 6.0, x + 6.0, y + 6.0)
    for place in found:
        for values in draw_cases(scenario)[::3]:
            case = cast(scenario, values, place, vehicle=VEHICLE)
            assert isinstance(case, StagedCase)
            (bicycle,) = case.actors
            walked = bicycle.speed_mps * np.linspace(0.0, case.impact_time_s, 40)
            line = FrenetPath(bicycle.xy_m).point_at(bicycle.start_arc_m + walked)
            assert not house.intersects(shapely.LineString(line))


def test_places_of_a_scenario_have_names_of_their_own() -> None:
    for id_ in ("cpta", "occluded_pedestrian"):
        names = [place.name for place in placed(id_, cross(signals=True))]
        assert len(set(names)) == len(names)


def live_path(world: World, turn: str) -> tuple[RoadNetwork, FrenetPath]:
    """Return a car's path that wanders a little beside the lanes."""
    roads = RoadNetwork(world)
    passages = roads.passages(world.intersection.id)
    way = roads.way(next(passage for passage in passages if passage.turn == turn))
    arcs = np.arange(way.entry_m - 60.0, way.exit_m + 60.0, 1.0)
    offset = 0.4 * np.sin(arcs / 9.0)
    return roads, FrenetPath(way.path.point_at(arcs, offset))


@pytest.mark.parametrize("turn", ["straight", "across", "near"])
@pytest.mark.parametrize("world", [cross(), cross(left_hand=True), ring(), tee()])
def test_the_connection_that_a_path_takes_is_found_by_its_shape(world: World, turn: str) -> None:
    roads, path = live_path(world, turn)
    finder = PassageFinder(roads)
    found = finder.first_on(path, 5.0)
    assert found is not None
    assert found.turn == turn
    assert finder.first_on(path, path.length_m - 5.0) is None


def test_who_joins_the_ring_enters_where_the_ego_passes() -> None:
    scenario = Scenario(
        id="x", title="x", shows="x.", source="x",
        where=Where(kinds=("roundabout",)), ego=EgoPart(turn="straight", speed_mps=4.0),
        actors=(ActorPart(name="other", relation="joins_ring", speed_mps=6.0, impact_share=0.0),),
    )  # fmt: skip
    result = places(scenario, ring())
    assert result.places
    for place in result.places:
        assert place.actor_ways[0][0].name.split("+")[0] != place.ego.name.split("+")[0]


def test_the_clearest_turn_comes_first() -> None:
    right, fork = math.radians(-90.0), math.radians(-25.0)
    assert unlike_its_turn("near", right) < unlike_its_turn("near", fork)
    assert unlike_its_turn("across", -right + math.tau) == unlike_its_turn("near", right) == 0
    assert unlike_its_turn("straight", fork) > unlike_its_turn("straight", 0.05) == 0
    world = tee((0.0, 180.0, 235.0, 270.0))
    network = RoadNetwork(world)
    for id_ in ("cbta", "cpta"):
        first = places(catalogue()[id_], world, most=1).places[0]
        passages = {p.name: p for p in network.passages(first.junction_id)}
        offs = [
            unlike_its_turn(p.turn, p.exit_heading_rad - p.entry_heading_rad)
            for p in passages.values()
            if p.turn == catalogue()[id_].ego.turn
        ]
        chosen = passages[first.ego.name]
        off = unlike_its_turn(chosen.turn, chosen.exit_heading_rad - chosen.entry_heading_rad)
        assert off == min(offs) < max(offs)


def test_an_adult_walks_over_the_crossing_that_the_map_has_beyond_the_exit() -> None:
    arms = {end: [end, 0] for end in (1, 2, 4)} | {3: [3, 5, 0]}
    osm = drawn_map(
        CROSS | {5: (-25.0, 0.0)},
        [(10 + end, nodes, STREET) for end, nodes in arms.items()],
        node_tags={5: {"highway": "crossing", "crossing": "zebra"}},
    )
    exits_and_crossings = {
        (place.ego.name.split(">")[1].split(".")[0], "over n5" in place.actor_ways[0][0].name)
        for place in placed("cpta", world_of(osm))
    }
    assert ("w13", True) in exits_and_crossings
    assert {exit_ for exit_, over in exits_and_crossings if over} == {"w13"}


def test_scenarios_share_the_walks_over_an_arm() -> None:
    network = RoadNetwork(cross())
    (junction,) = network.world.junctions
    near = next(p for p in network.passages(junction.summary.id) if p.turn == "near")
    first, other = (
        [place.actor_ways[0][0] for place in places_on_passage(catalogue()[id_], network, near)]
        for id_ in ("cbta", "latency")
    )
    assert len(first) >= 4
    assert {id(way) for way in first} == {id(way) for way in other}

    def over(relation: Relation, turn: TrafficTurn) -> set[str]:
        walker = ActorPart(name="walker", relation=relation, turn=turn)
        return {str(way.path.node_poses) for way in ways_of(walker, network, near, ego)}

    ego = network.way(near)
    assert not over("crosses_exit", "straight") & over("crosses_entry", "straight")
    assert over("crosses_exit", "across") < over("crosses_exit", "straight")
