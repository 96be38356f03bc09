"""What lights show, by whose word, and where vehicles wait for them."""

from __future__ import annotations

import numpy as np
import pytest

from foretwin.contracts.drive import SignalState
from foretwin.contracts.frames import local_pose
from foretwin.contracts.lights import ShownLight
from foretwin.contracts.signals import LearntSignal
from foretwin.contracts.world import World
from foretwin.orchestrator.runtime_configuration.handler import RefusedError
from foretwin.orchestrator.runtime_configuration.lights import LightHandler, LightsInForce
from foretwin.world_gen.rules.signal_state import world_colours_at
from tests.orchestrator.trip import town, town_world

S = 10**9


@pytest.fixture(scope="module")
def world() -> World:
    names = [one.summary.id for one in town().junctions if one.summary.control == "signals"]
    return town_world(names[0])


@pytest.fixture
def lights(world: World) -> LightsInForce:
    made = LightsInForce()
    made.use_world(world)
    return made


def shown(lights: LightsInForce, time_s: float, **said: list) -> dict[str, ShownLight]:  # type: ignore[type-arg]
    found = lights.shown(round(time_s * S), 0, said.get("heard", {}), said.get("learnt", []))
    return {one.group_id: one for one in found.lights}


def test_a_plan_is_told_as_it_runs_and_what_comes_next(lights: LightsInForce, world: World) -> None:
    for time_s in np.arange(0.05, 130.0, 3.7).tolist():
        now, by_plan = shown(lights, time_s), world_colours_at(world, time_s)
        assert {name: one.colour for name, one in now.items()} == by_plan
        for name, one in now.items():
            assert one.why == "plan"
            assert one.changes_in_s is not None
            after = world_colours_at(world, time_s + one.changes_in_s + 0.01)[name]
            before = world_colours_at(world, time_s + one.changes_in_s - 0.01)[name]
            assert (before, after) == (one.colour, one.next_colour)


def test_by_hand_before_heard_before_learnt_before_plan(lights: LightsInForce) -> None:
    group = sorted(lights.groups)[0]
    learnt = LearntSignal(
        group_id=group, begins_ns=0, cycle_s=60.0, from_s=(0.0, 20.0, 23.0),
        colours=("green", "amber", "red"), cycles=3, spread_s=0.1,
    )  # fmt: skip
    heard = SignalState(stamp_ns=70 * S, group_id=group, colour="red_amber")
    one = shown(lights, 70.0, learnt=[learnt])[group]
    assert (one.colour, one.why, one.next_colour) == ("green", "learnt", "amber")
    assert one.changes_in_s == pytest.approx(10.0)
    one = shown(lights, 70.0, learnt=[learnt], heard={group: heard})[group]
    assert (one.colour, one.why, one.changes_in_s) == ("red_amber", "heard", None)
    # Two seconds later nobody has heard of it any more.
    assert shown(lights, 72.1, learnt=[learnt], heard={group: heard})[group].why == "learnt"
    LightHandler(lights).make(group, "dark", stamp_ns=0)
    one = shown(lights, 70.0, learnt=[learnt], heard={group: heard})[group]
    assert (one.colour, one.why, one.binds_car) == ("dark", "set", True)


def test_vehicles_wait_at_the_stop_lines_of_its_lanes(lights: LightsInForce, world: World) -> None:
    by_place = {
        (round(float(x), 3), round(float(y), 3)): line
        for line in world.stop_lines
        for x, y in [np.mean(line.ends, axis=0)]
    }
    lanes = {lane.id: lane for lane in world.lanes}
    told = 0
    for one in shown(lights, 0.0).values():
        for stop in one.stops:
            x, y, yaw = local_pose(world.frame, stop.position, stop.yaw_rad)
            line = by_place[round(x, 3), round(y, 3)]
            way = np.diff(lanes[line.lane_id].centerline[-2:], axis=0)[0]
            assert np.cos(yaw - np.arctan2(way[1], way[0])) > 0.9
            groups = {
                c.signal_group_id for c in world.connections if c.from_lane_id == line.lane_id
            }
            assert one.group_id in groups
            told += 1
    assert told >= 4
    walking = {g.id for p in world.junctions if p.plan for g in p.plan.groups if g.crossing_ids}
    assert {name for name, one in shown(lights, 0.0).items() if one.on_foot} <= walking


def test_without_a_world_there_are_no_lights(lights: LightsInForce) -> None:
    lights.use_world(None)
    assert lights.shown(0, 0, {}, []).lights == ()


def test_what_is_no_light_or_no_colour_is_refused(lights: LightsInForce) -> None:
    handler = LightHandler(lights)
    group = sorted(lights.groups)[0]
    with pytest.raises(RefusedError, match=r"light\.elsewhere: no such light around the car"):
        handler.check("elsewhere", "red")
    for wrong in ("blue", "unknown", ""):
        with pytest.raises(RefusedError, match=f"={wrong}: must be red, red_amber, .* or auto"):
            handler.check(group, wrong)
    handler.check(group, "red")
    assert handler.make(group, "red", stamp_ns=0) == ("auto", "red")
    # A light that was set can be given back from afar.
    lights.use_world(None)
    handler.check(group, "auto")
    assert handler.make(group, "auto", stamp_ns=0) == ("red", "auto")
    assert lights.set == {}
