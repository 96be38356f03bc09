"""What virtual traffic is told and heard of: World and way before each round, its road users in
futures, on and off while driving."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import msgspec
import pyarrow.parquet as pq
import pytest

from foretwin.contracts.drive import RoadUser, RoadUsers
from foretwin.contracts.frames import GeoPoint
from foretwin.contracts.futures import Job
from foretwin.contracts.keys import alive_key
from foretwin.contracts.mailbox import Request
from foretwin.contracts.virtual_traffic import TrafficCourse, VirtualTraffic
from foretwin.orchestrator.drive.virtual_traffic_link import MOST_RECORDED
from foretwin.orchestrator.runtime_configuration.handler import RefusedError
from tests.orchestrator.house import House, Process

STEP_NS = 50_000_000


class Traffic(Process):
    """Takes courses."""

    def __init__(self, house: House) -> None:
        self.told: list[TrafficCourse] = []
        super().__init__(house.plan, house.bus, "traffic", ("use_course",), at_once=True)

    def answer_one(self, request: Request) -> None:
        self.told.append(request.message())
        request.reply(self.told[-1])


@pytest.fixture
def house(tmp_path: Path) -> Iterator[House]:
    made = House(tmp_path, virtual_traffic=VirtualTraffic(source="model"))
    yield made
    made.tables.close()


def heard(house: House, *, later_ns: int = 0, name: str = "virtual-1") -> RoadUsers:
    """One road user 20 m from the car, said on the bus."""
    latest = house.conductor.intake.latest
    assert latest is not None
    state = latest.state
    user = RoadUser(
        user_id=name, kind="car", position=state.position, yaw_rad=0.0, speed_mps=5.0,
        length_m=4.5, width_m=1.8, virtual=True,
    )  # fmt: skip
    message = RoadUsers(stamp_ns=state.stamp_ns + later_ns, users=(user,))
    house.bus.publish("virtual_traffic", message, run=house.plan.run_id)
    house.settle()
    return message


def round_of(house: House) -> list[Job]:
    """The jobs of a round that is begun now."""
    assert house.conductor.start_round()
    house.settle()
    jobs = [request.message().decoded() for worker in house.workers for request in worker.take()]
    assert jobs
    return jobs


def test_it_is_told_where_the_car_will_drive_and_again_when_it_comes_back(house: House) -> None:
    traffic = Traffic(house)
    house.drive(20)
    round_of(house)
    (course,) = traffic.told
    assert course.world_id in house.mission.worlds_ahead()
    assert course.path is not None
    assert course.on
    assert course.stamp_ns == house.conductor.intake.now_stamp_ns + 1
    assert course.start_stamp_ns == house.conductor.intake.start_stamp_ns
    assert house.conductor.questions.unanswered == 0
    house.bus.lose(alive_key(run=house.plan.run_id, process="traffic"))
    house.settle()
    again = Traffic(house)
    house.settle()
    assert [one.world_id for one in again.told] == [course.world_id]


def test_futures_meet_its_road_users_while_these_are_fresh(house: House) -> None:
    Traffic(house)
    house.drive(20)
    heard(house)
    jobs = round_of(house)
    assert {user.user_id for job in jobs for user in job.road_users} == {"virtual-1"}


def test_road_users_of_long_ago_meet_nobody(house: House) -> None:
    Traffic(house)
    house.drive(20)
    heard(house, later_ns=-5_000_000_000)
    assert all(not job.road_users for job in round_of(house))


def test_who_was_detected_as_well_is_there_once(house: House) -> None:
    Traffic(house)
    house.drive(20)
    seen = heard(house)
    real = msgspec.structs.replace(seen.users[0], user_id="real", virtual=False)
    fake = msgspec.structs.replace(seen.users[0], virtual=False, speed_mps=99.0)
    detected = RoadUsers(stamp_ns=seen.stamp_ns, users=(real, fake))
    house.bus.publish("objects", detected, vehicle="ego")
    house.settle()
    users = round_of(house)[0].road_users
    assert [(user.user_id, user.speed_mps) for user in users] == [("real", 5.0), ("virtual-1", 5.0)]


def test_it_is_switched_off_and_on_while_driving(house: House) -> None:
    traffic, link = Traffic(house), house.conductor.traffic
    house.drive(20)
    round_of(house)
    assert link.make("", "off", stamp_ns=1) == ("on", "off")
    house.settle()
    assert not traffic.told[-1].on
    assert link.make("", "on", stamp_ns=2) == ("off", "on")
    house.settle()
    assert traffic.told[-1].on
    for name, value in (("x", "on"), ("", "maybe")):
        with pytest.raises(RefusedError, match="must be virtual_traffic=on or off"):
            link.check(name, value)
    link.check("", "off")


def test_a_drive_without_it_asks_nobody_and_cannot_switch(tmp_path: Path) -> None:
    house = House(tmp_path)
    traffic, link = Traffic(house), house.conductor.traffic
    house.drive(20)
    heard(house)
    assert all(not job.road_users for job in round_of(house))
    assert traffic.told == []
    with pytest.raises(RefusedError, match="started without any"):
        link.check("", "on")
    assert link.record()["rate_hz"] is None
    house.tables.close()


def test_in_lock_step_what_it_makes_of_the_newest_state_is_waited_for(house: House) -> None:
    link = house.conductor.traffic
    house.drive(20)
    assert not link.is_behind  # Nobody is there.
    Traffic(house)
    house.settle()
    assert not link.is_behind  # It knows of no World.
    round_of(house)
    assert not link.is_behind  # What it was told counts from the next state on.
    house.drive(21)
    assert link.is_behind
    heard(house, later_ns=-STEP_NS)
    assert link.is_behind
    heard(house, later_ns=-STEP_NS + 1)
    assert not link.is_behind


def test_the_record_says_how_steady_it_was(house: House) -> None:
    Traffic(house)
    house.drive(20)
    for k in (0, 1, 2, 6):
        heard(house, later_ns=k * STEP_NS)
    record = house.conductor.traffic.record()
    assert record == {"messages": 4, "most_users": 1, "rate_hz": 10.0, "missed": 3}


def test_where_they_were_is_recorded_five_times_a_second(house: House) -> None:
    house.drive(20)
    said = [heard(house, later_ns=k * STEP_NS) for k in (0, 1, 3, 4, 5, 8, 2)]
    house.tables.close()
    rows = pq.read_table(house.plan.folder / "results" / "virtual_road_users.parquet").to_pylist()
    # A clock that steps back begins anew.
    assert [row["stamp_ns"] for row in rows] == [said[k].stamp_ns for k in (0, 3, 5, 6)]
    user = said[0].users[0]
    assert rows[0] == {
        "stamp_ns": said[0].stamp_ns, "user_id": "virtual-1", "kind": "car",
        "lat_deg": user.position.lat_deg, "lon_deg": user.position.lon_deg, "yaw_rad": 0.0,
        "speed_mps": 5.0, "length_m": 4.5, "width_m": 1.8,
    }  # fmt: skip


def test_of_a_crowd_the_nearest_are_recorded(house: House) -> None:
    house.drive(20)
    latest = house.conductor.intake.latest
    assert latest is not None
    at = latest.state.position
    crowd = tuple(
        RoadUser(
            user_id=f"virtual-{k}", kind="car", yaw_rad=0.0, speed_mps=0.0, length_m=4.5,
            width_m=1.8, virtual=True, position=GeoPoint(at.lat_deg + 1e-5 * (200 - k), at.lon_deg),
        )
        for k in range(200)
    )  # fmt: skip
    house.conductor.traffic.take(RoadUsers(stamp_ns=latest.state.stamp_ns, users=crowd))
    house.tables.close()
    table = pq.read_table(house.plan.folder / "results" / "virtual_road_users.parquet")
    names = [f"virtual-{k}" for k in range(200 - MOST_RECORDED, 200)]
    assert table["user_id"].to_pylist() == names
