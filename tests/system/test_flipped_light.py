"""A light that is flipped while a drive goes on stops futures, virtual traffic and the stand-in,
each within one of their control ticks of its arrival."""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path

import pytest
from msgspec.structs import replace

from foretwin.contracts.codec import read_message
from foretwin.contracts.drive import ControlCommand, RoadUser
from foretwin.contracts.frames import LocalFrame, local_pose, wrap_angle
from foretwin.contracts.futures import Job
from foretwin.contracts.lights import ShownLights
from foretwin.contracts.mailbox import Mailbox
from foretwin.contracts.simulation import PrepareRequest
from foretwin.contracts.tuning import SetRequest
from foretwin.contracts.virtual_traffic import TrafficCourse
from foretwin.contracts.world import World
from foretwin.sim_worker.futures.run_job import run_alone
from foretwin.sim_worker.vehicle.parameters import load_vehicle
from foretwin.sim_worker.virtual_traffic.going import STEP_NS, GoingTraffic
from foretwin.sim_worker.virtual_traffic.model import ModelTraffic
from foretwin.telemetry.standin.lights_ahead import lights_ahead
from foretwin.telemetry.standin.parameters import read_parameters
from foretwin.telemetry.standin.path import DrivenPath
from foretwin.telemetry.standin.source import START_STAMP_NS, StandinSource
from tests.orchestrator.house import House
from tests.orchestrator.trip import town

CAR = load_vehicle()
GROUPS = ("n44:g0", "n44:g1")
"""Of the lights at which the town's car arrives after 49 s."""


@pytest.fixture
def house(tmp_path: Path) -> Iterator[House]:
    made = House(tmp_path, futures=1, futures_per_job=1)
    yield made
    made.tables.close()


def flip(house: House, colour: str) -> None:
    for group in GROUPS:
        request = SetRequest(key=f"light.{group}", value=colour)
        house.bus.request("set", request, Mailbox(1), run=house.plan.run_id)
    house.settle()
    house.conductor.make_changes()


def asked(house: House) -> Job:
    """The job of a round that is begun now; it is answered as ever."""
    assert house.conductor.start_round()
    house.settle()
    found = []
    for worker in house.workers:
        for request in worker.take():
            message = request.message()
            if not isinstance(message, PrepareRequest):
                found.append(message.decoded())
            worker.answer_one(request)
    house.settle()
    (job,) = found
    return job


def test_futures_brake_in_the_first_round_after_it(house: House) -> None:
    house.drive(450)
    before = asked(house)
    flip(house, "red")
    after = asked(house)
    flip(house, "auto")
    given_back = asked(house)
    assert [len(job.signals) for job in (before, after, given_back)] == [0, 2, 0]
    world = read_message(house.plan.worlds_dir / f"{after.world_id}.world", World)
    free, stopped = (
        run_alone(job, world, CAR).trajectory.states[0, :, 3] for job in (before, after)
    )
    assert stopped[0] == free[0]
    # A step of a result is two control ticks.
    assert stopped[1] < free[1] - 0.1
    assert stopped[-1] < 1.5


def shown(house: House) -> ShownLights:
    """What the orchestrator says of lights now."""
    mailbox = Mailbox(10)
    house.bus.subscribe("lights", mailbox, run=house.plan.run_id)
    house.conductor.lights.say()
    item = mailbox.take()
    assert item is not None
    found: ShownLights = item.message()
    return found


def comes_up(user: RoadUser, earlier: RoadUser | None, lights: ShownLights) -> bool:
    """Whether a road user drives up to one of the lights steadily, and is 11 to 17 m away."""
    if earlier is None or abs(user.speed_mps - earlier.speed_mps) > 0.005:
        return False
    for light in lights.lights:
        for stop in light.stops if light.group_id in GROUPS else ():
            x_m, y_m, yaw_rad = local_pose(LocalFrame(user.position), stop.position, stop.yaw_rad)
            cos, sin = math.cos(user.yaw_rad), math.sin(user.yaw_rad)
            ahead_m, left_m = cos * x_m + sin * y_m, cos * y_m - sin * x_m
            along = abs(wrap_angle(yaw_rad - user.yaw_rad)) < 0.2 and abs(left_m) < 1.0
            if user.speed_mps > 5.0 and along and 11.0 < ahead_m < 17.0:
                return True
    return False


class Flow:
    """Virtual traffic in the World of these lights, beside a car that stands."""

    def __init__(self, house: House, lights: ShownLights) -> None:
        assert lights.world_id is not None
        world = read_message(house.plan.worlds_dir / f"{lights.world_id}.world", World)
        self._car, self._steps = replace(house.states[449], speed_mps=0.0), 0
        begin_ns = self._car.stamp_ns
        self._traffic = GoingTraffic(ModelTraffic(CAR, count=16, seed=3), CAR)
        course = TrafficCourse(
            stamp_ns=begin_ns, start_stamp_ns=begin_ns, world_id=world.id, path=None, on=True
        )
        self._traffic.take_course(course, world)

    def step(self, lights: ShownLights) -> dict[str, RoadUser]:
        stamp_ns = self._car.stamp_ns + self._steps * STEP_NS
        self._traffic.take_lights(replace(lights, stamp_ns=stamp_ns))
        (said,) = self._traffic.take_state(replace(self._car, stamp_ns=stamp_ns))
        self._steps += 1
        return {user.user_id: user for user in said.users}


def test_drivers_of_virtual_traffic_brake_in_the_next_step(house: House) -> None:
    house.drive(450)
    flip(house, "green")
    green = shown(house)
    flip(house, "red")
    red = shown(house)
    flow, steps = Flow(house, green), 0
    before, coming = flow.step(green), list[str]()
    while not coming:
        earlier, before = before, flow.step(green)
        coming = [name for name, user in before.items() if comes_up(user, earlier.get(name), green)]
        steps += 1
        assert steps < 1200, "nobody came up to the lights"
    shown_red = Flow(house, green)
    for _ in range(steps + 1):
        shown_red.step(green)
    went_on, stopping = flow.step(green), shown_red.step(red)
    for name in coming:
        assert stopping[name].speed_mps < went_on[name].speed_mps - 0.001
    for _ in range(160):
        stopping = shown_red.step(red)
    assert all(stopping[name].speed_mps < 0.5 for name in coming)


def test_the_stand_in_brakes_in_its_next_control_tick(house: House) -> None:
    house.drive(450)
    flip(house, "red")
    red = shown(house)
    line, parameters = town().standin, read_parameters(None)
    assert line is not None
    path = DrivenPath(line.lat_deg, line.lon_deg, line.speed_mps, driver=parameters.driver)
    car, now_ns = StandinSource(path, parameters, vehicle_id="ego"), START_STAMP_NS

    def advance() -> float:
        """Go on by a control tick; return what the driver then asks for in m/s²."""
        nonlocal now_ns
        now_ns += 20_000_000
        told = [one for name, one in car.advance(now_ns) if name == "control"][-1]
        assert isinstance(told, ControlCommand)
        assert told.accel_mps2 is not None
        return told.accel_mps2

    def left_m() -> float:
        return min((one.s_m for one in lights_ahead(path, car.s_m, red)), default=1e9) - car.s_m

    before_mps2 = advance()
    while left_m() > 25.0:
        before_mps2 = advance()
    needed_mps2 = car.speed_mps**2 / (2.0 * left_m())
    car.heed(replace(red, stamp_ns=now_ns))
    at_once_mps2 = advance()
    assert at_once_mps2 < before_mps2 - 1.0
    assert at_once_mps2 == pytest.approx(-needed_mps2, rel=0.1)
