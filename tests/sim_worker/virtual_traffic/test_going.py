"""Virtual traffic steps in the car's time, whatever comes between, and says what it left out."""

from __future__ import annotations

from collections.abc import Mapping

import msgspec
import numpy as np
import pytest

from foretwin.contracts.arrays import Array
from foretwin.contracts.drive import RoadUsers, SignalColour, SignalState
from foretwin.contracts.frames import LocalFrame, local_from_geo, local_from_geo_yaw
from foretwin.contracts.lights import ShownLight, ShownLights
from foretwin.contracts.signals import SignalGroup, SignalPhase, SignalPlan
from foretwin.contracts.virtual_traffic import TrafficCourse
from foretwin.contracts.world import World
from foretwin.sim_worker.vehicle.parameters import load_vehicle
from foretwin.sim_worker.virtual_traffic.going import STEP_NS, GoingTraffic
from foretwin.sim_worker.virtual_traffic.model import ModelTraffic
from foretwin.sim_worker.virtual_traffic.source import VirtualUser
from tests.sim_worker.places import FRAME, crossroads, state_at, straight_path

START_NS = 5_000_000_000
WORLD = crossroads()


class Noted:
    """A source with one road user, who is where the car is; notes what it is told."""

    def __init__(self) -> None:
        self.frame: LocalFrame | None = None
        self.worlds: list[str] = []
        self.paths = 0
        self.times_s: list[float] = []
        self.colours: dict[str, SignalColour] = {}

    def use_world(self, world: World) -> None:
        self.worlds.append(world.id)
        self.frame = world.frame

    def use_path(self, xy_m: Array) -> None:
        self.paths += 1

    def step(
        self, car: Array, *, time_s: float, colours: Mapping[str, SignalColour]
    ) -> tuple[VirtualUser, ...]:
        self.times_s.append(time_s)
        self.colours = dict(colours)
        x, y, yaw, speed = car[:4].tolist()
        return (VirtualUser("one", "bus", x, y, yaw, speed, 12.0, 2.5),)


def course(at_s: float, *, on: bool = True, world: str | None = "crossroads") -> TrafficCourse:
    return TrafficCourse(
        stamp_ns=START_NS + round(at_s * 1e9), start_stamp_ns=START_NS, world_id=world,
        path=straight_path(), on=on,
    )  # fmt: skip


def going() -> tuple[GoingTraffic, Noted]:
    source = Noted()
    return GoingTraffic(source, load_vehicle()), source


def at(traffic: GoingTraffic, *times_s: float) -> list[RoadUsers]:
    return [
        users
        for time_s in times_s
        for users in traffic.take_state(
            state_at(10.0 * time_s, -1.5, stamp_ns=START_NS + round(time_s * 1e9))
        )
    ]


def fifty_hz(from_s: float, to_s: float) -> list[float]:
    return [k / 50.0 for k in range(round(from_s * 50), round(to_s * 50))]


def test_it_steps_at_20_hz_of_the_cars_time_and_marks_everybody_virtual() -> None:
    traffic, source = going()
    assert at(traffic, 0.0, 0.02) == []  # Nobody has said where.
    traffic.take_course(course(0.03), WORLD)
    said = at(traffic, *fifty_hz(0.04, 2.0))
    stamps = [users.stamp_ns for users in said]
    assert np.diff(stamps).tolist() == [STEP_NS] * (len(stamps) - 1)
    assert len(stamps) == 39
    assert stamps[0] == START_NS + 40_000_000
    assert source.times_s[0] == pytest.approx(0.04)
    assert all(user.virtual for users in said for user in users.users)
    (user,) = said[-1].users
    degrees = user.position.lat_deg, user.position.lon_deg
    assert local_from_geo(FRAME, *degrees) == pytest.approx([19.4, -1.5], abs=0.01)
    assert float(local_from_geo_yaw(FRAME, user.yaw_rad, *degrees)) == pytest.approx(0.0, abs=1e-9)


def test_a_course_counts_from_its_stamp_on() -> None:
    traffic, source = going()
    traffic.take_course(course(0.0), WORLD)
    traffic.take_course(course(1.0), None)
    at(traffic, *fifty_hz(0.0, 1.0))
    assert (source.worlds, source.paths) == (["crossroads"], 1)
    at(traffic, 1.0)
    assert (source.worlds, source.paths) == (["crossroads"], 2)


def test_switched_off_it_says_once_that_nobody_is_there() -> None:
    traffic, source = going()
    traffic.take_course(course(0.0), WORLD)
    traffic.take_course(course(1.0, on=False), None)
    traffic.take_course(course(1.5, on=False), None)
    traffic.take_course(course(2.0), None)
    off = [users for users in at(traffic, *fifty_hz(0.0, 2.0)) if not users.users]
    assert [users.stamp_ns - START_NS for users in off] == [1_000_000_000]
    steps = len(source.times_s)
    assert at(traffic, *fifty_hz(2.0, 2.5))
    assert len(source.times_s) == steps + 10
    assert traffic.missed == 0


def test_after_a_silence_it_goes_on_and_counts_what_it_left_out() -> None:
    traffic, _ = going()
    traffic.take_course(course(0.0), WORLD)
    at(traffic, *fifty_hz(0.0, 1.0))
    (users,) = at(traffic, 4.0)
    assert users.stamp_ns == START_NS + 4_000_000_000
    assert traffic.missed == 60
    # Some lost states cost no step.
    assert len(at(traffic, 4.16)) == 3
    assert traffic.missed == 60


@pytest.mark.parametrize("every_s", [0.1, 0.2, 1.0])
def test_a_car_that_seldom_says_where_it_is_has_traffic_at_20_hz_as_well(every_s: float) -> None:
    traffic, _ = going()
    traffic.take_course(course(0.0), WORLD)
    jitter_s = np.random.default_rng(1).uniform(-1e-4, 1e-4, round(20.0 / every_s) + 1)
    said = at(traffic, *(np.arange(len(jitter_s)) * every_s + 1.0 + jitter_s))
    assert traffic.missed == 0
    assert len(said) == pytest.approx(400, abs=2)


def test_where_the_clock_steps_back_it_goes_on_from_there() -> None:
    traffic, _ = going()
    traffic.take_course(course(0.0), WORLD)
    at(traffic, *fifty_hz(3.0, 4.0))
    assert len(at(traffic, *fifty_hz(1.0, 2.0))) == 20
    assert traffic.missed == 0


def test_lights_are_what_was_shown_last_and_by_plan_after_a_while() -> None:
    plan = SignalPlan(
        groups=(SignalGroup(id="g", connection_ids=("east",)),),
        phases=(SignalPhase(green_s=60.0, green_group_ids=("g",)),),
        amber_s=3.0, all_red_s=2.0, source="default",
    )  # fmt: skip
    (junction,) = WORLD.junctions
    lit = msgspec.structs.replace(WORLD, junctions=(msgspec.structs.replace(junction, plan=plan),))
    traffic, source = going()
    heard = SignalState(stamp_ns=START_NS, group_id="g", colour="red")
    traffic.take_course(msgspec.structs.replace(course(0.0), signals=(heard,)), lit)
    at(traffic, 0.0)
    assert source.colours == {"g": "red"}
    light = ShownLight(group_id="g", colour="amber", why="set")
    traffic.take_lights(ShownLights(stamp_ns=START_NS + 50, world_id="w", lights=(light,)))
    at(traffic, 0.06)
    assert source.colours == {"g": "amber"}
    at(traffic, *fifty_hz(0.1, 2.2))
    assert source.colours == {"g": "green"}


def test_the_model_gives_the_same_bits_from_the_same_states() -> None:
    def run() -> list[RoadUsers]:
        traffic = GoingTraffic(ModelTraffic(load_vehicle(), count=6, seed=1), load_vehicle())
        traffic.take_course(course(0.0), WORLD)
        return at(traffic, *fifty_hz(0.0, 8.0))

    first, second = run(), run()
    assert first == second
    assert len(first) == 160
    assert len(first[-1].users) == 6
