"""The conductor between bus and core: Worlds asked for and loaded, rounds run, faults survived."""

from __future__ import annotations

import math
import time
from collections.abc import Iterator
from pathlib import Path

import msgspec
import numpy as np
import pyarrow.parquet as pq
import pytest

from foretwin.contracts.codec import encode
from foretwin.contracts.drive import GnssFix, SpeedSample
from foretwin.contracts.frames import GeoPoint, LocalFrame, local_from_geo
from foretwin.contracts.mailbox import Received, Reply
from foretwin.orchestrator.drive.conductor import Conductor
from foretwin.orchestrator.drive.world_handler import ASKS_AGAIN_AFTER_S, MOST_UNANSWERED
from foretwin.orchestrator.runner.bus_dispatcher import NO_ANSWER
from tests.orchestrator.house import INFO, Builder, House, Worker

COVERS = (
    "foretwin.orchestrator.context",
    "foretwin.orchestrator.drive.events",
    "foretwin.orchestrator.drive.world_handler",
)


@pytest.fixture
def house(tmp_path: Path) -> Iterator[House]:
    made = House(tmp_path)
    yield made
    made.tables.close()


def ready(conductor: Conductor) -> list[str]:
    return conductor.mission.worlds_ahead()


def test_what_is_said_before_the_car_has_a_clock_carries_no_stamp(house: House) -> None:
    conductor = house.conductor
    conductor.active_world.mirror_up()
    conductor.intake.info = None  # a live car that has not come yet
    conductor.active_world.mirror_up()
    told = [one.stamp_ns for one in house.watched("active_world")]
    assert told == [INFO.start_stamp_ns + 1, 0]


def test_a_world_is_ready_once_every_worker_has_loaded_it(house: House) -> None:
    house.drive(20, working=False)
    assert "n4" in house.conductor.worlds.building
    house.builder.answer()
    house.settle()
    assert ready(house.conductor) == []

    first, second = house.workers
    first.answer()
    house.settle()
    assert first.prepared
    assert ready(house.conductor) == []

    second.answer()
    house.settle()
    assert set(ready(house.conductor)) == set(first.prepared) == set(second.prepared)
    assert house.conductor.worlds.building == []
    notices = house.watched("world")
    assert {n.world_id for n in notices} == set(first.prepared)
    assert all((house.plan.worlds_dir / n.file).exists() for n in notices)


def test_a_worker_that_dies_while_loading_is_waited_for_no_more(house: House) -> None:
    house.drive(20, working=False)
    house.builder.answer()
    house.settle()
    house.workers[0].answer()
    house.workers[1].die()
    house.settle()

    assert ready(house.conductor)
    assert house.conductor.rounds.dispatcher.workers == ("w0",)


def test_a_worker_that_hangs_while_loading_is_waited_for_until_it_is_gone(house: House) -> None:
    house.drive(20, working=False)
    house.builder.answer()
    house.settle()
    house.workers[0].answer()
    unanswered = house.workers[1].take()
    house.settle()
    assert unanswered
    assert ready(house.conductor) == []

    house.workers[1].die()
    house.settle()
    assert ready(house.conductor)


def test_a_worker_that_comes_back_loads_what_the_coming_rounds_need(house: House) -> None:
    house.drive(20)
    house.workers[1].die()
    house.settle()
    back = Worker(house.plan, house.bus, "w1")
    house.settle()
    back.answer()

    assert back.prepared == ready(house.conductor)


def test_a_builder_that_dies_is_asked_again_when_it_is_back(house: House) -> None:
    house.drive(20, working=False)
    house.builder.die()
    house.settle()
    assert ready(house.conductor) == []
    assert not any(event.level == "error" for event in house.watched("event"))

    house.builder = Builder(house.plan, house.bus)
    house.settle()
    house.work()
    assert "n4" in house.builder.asked
    assert ready(house.conductor)


def test_a_question_for_a_world_that_found_nobody_is_asked_again(house: House) -> None:
    """As while the link to the router is away: the builder is up, and nothing reaches it."""
    house.drive(1, working=False)
    house.builder.answer()
    house.settle()
    worlds = house.conductor.worlds
    worlds.want("n11", load=False, workers=())
    lost = Reply("build", "n11", None, NO_ANSWER, 0)
    for _ in range(MOST_UNANSWERED):
        house.builder.take()
        house.conductor.handle(lost)
        worlds.ask_again(time.monotonic())
        assert house.builder.take() == []
        worlds.ask_again(time.monotonic() + 2.0 * ASKS_AGAIN_AFTER_S)
        worlds.ask_again(time.monotonic() + 4.0 * ASKS_AGAIN_AFTER_S)
        assert len(house.builder.take()) == 1
        assert "n11" in worlds.building
    house.conductor.handle(lost)
    assert "n11" not in worlds.building, "given up in the end"


def test_a_world_that_was_built_is_not_built_again(house: House) -> None:
    house.drive(20)
    asked = list(house.builder.asked)
    house.builder.die()
    house.builder = Builder(house.plan, house.bus)
    house.settle()
    house.work()
    house.drive(60)

    assert not set(asked) & set(house.builder.asked)


def test_what_cannot_be_built_is_told_and_passed_over(house: House) -> None:
    house.drive(20, working=False)
    house.builder.refuses = ("n4",)
    house.builder.answer()
    house.settle()
    house.work()

    (error,) = (e for e in house.watched("event") if e.level == "error")
    assert error.text == "no world for Lime Street West \u00d7 Mill Lane: the map is torn there"
    assert house.conductor.start_round()


def other_schema(house: House, state_number: int) -> Received:
    state = house.states[state_number]
    data = bytearray(encode(GnssFix(stamp_ns=state.stamp_ns, position=state.position)))
    data[4] = 99
    return Received("gnss", "foretwin/v1/vehicle/ego/telemetry/gnss", bytes(data), GnssFix)


def test_samples_of_another_schema_are_refused_with_one_event(house: House) -> None:
    house.drive(5)
    for number in (5, 6, 7):
        house.conductor.handle(other_schema(house, number))
    house.drive(20)

    (error,) = (e for e in house.watched("event") if e.level == "error")
    assert "schema version 99" in error.text
    assert house.conductor.intake.refused == 3
    assert house.conductor.intake.skipped_invalid == 3
    assert house.conductor.intake.states == 20


def test_a_whole_drive_leaves_its_rounds_in_the_tables(house: House) -> None:
    house.drive(320, round_every=5)
    house.end()

    rounds = house.conductor.rounds
    folder = house.plan.folder / "results"
    rows = {p.stem: pq.read_table(p).to_pylist() for p in folder.glob("*.parquet")}
    assert rounds.futures.rounds == len(rows["rounds"]) > 30
    assert rounds.futures.count == len(rows["futures"]) == 6 * len(rows["rounds"])
    assert [r["round_id"] for r in rows["rounds"]] == list(range(len(rows["rounds"])))
    assert {r["worker_id"] for r in rows["futures"]} == {"w0", "w1"}
    assert {r["horizon_s"] for r in rows["comparisons"]} == {1.0, 2.0, 4.0, 8.0}
    records = house.mission.visits.records(mono_s=0.0)
    assert [r["id"] for r in records] == ["n4", "n11"]
    counted = {r["id"]: r["rounds"] for r in records}
    told = [r["intersection_id"] for r in rows["rounds"]]
    assert counted == {name: told.count(name) for name in counted}
    assert house.conductor.rounds.tally.missed == 0
    # These futures go straight on at the car's speed: they are the constant-velocity baseline.
    for row in rows["comparisons"]:
        assert row["nominal_ade_m"] == pytest.approx(row["constant_velocity_ade_m"], abs=0.01)


def test_those_who_watch_see_every_round(house: House) -> None:
    house.drive(60, round_every=10)
    views = house.watched("round")

    assert len(views) == house.conductor.rounds.futures.rounds > 2
    assert views[0].xy_m.shape == (6, 25, 2)
    assert views[0].names[0] == "nominal"
    assert not views[0].criticality.any()


def test_a_worker_that_dies_at_work_costs_no_future_and_counts_none_twice(house: House) -> None:
    house.drive(20)
    assert house.conductor.start_round()
    house.workers[0].die()
    house.settle()
    house.workers[1].answer()
    house.settle()
    house.workers[1].answer()
    house.settle()

    assert not house.conductor.rounds.open
    assert house.conductor.rounds.futures.count == 6
    assert house.conductor.rounds.futures.rounds == 1
    assert house.conductor.rounds.dispatcher.dispatch.requeued >= 1
    assert house.workers[1].jobs == 2


def test_a_round_whose_world_is_late_is_missed_and_one_without_heading_is_not(house: House) -> None:
    assert not house.conductor.start_round()
    house.drive(1, working=False)
    house.conductor.start_round()
    house.drive(20, working=False)
    house.conductor.start_round()

    assert (
        house.conductor.rounds.tally.missed == 2
    )  # near a junction, and nobody has built its World
    house.work()
    house.send(house.states[20])
    house.settle()
    assert house.conductor.start_round()
    assert (house.conductor.rounds.tally.missed, house.conductor.rounds.tally.unseeded) == (2, 0)


def test_the_reference_point_of_a_source_that_keeps_it_to_itself_is_mentioned(house: House) -> None:
    silent = msgspec.structs.replace(INFO, body_from_antenna_m=None, reference_point="roof")
    house.conductor.take_info(silent)

    (warning,) = (e for e in house.watched("event") if e.level == "warning")
    assert "roof" in warning.text


@pytest.mark.parametrize(("setting", "helped"), [("auto", True), ("off", False)])
def test_a_rough_receiver_is_helped_by_the_map_unless_told_not_to(
    tmp_path: Path, setting: str, helped: bool
) -> None:
    """The town's fixes lie in the lane driven; these say that they are good to 3 m, and lie 3 m
    to the left of it."""
    house = House(tmp_path, speed=None, map_aiding=setting)
    for state in house.states[:100]:
        yaw, place = state.yaw_rad, state.position
        beside = GeoPoint(
            place.lat_deg + 3.0 * math.cos(yaw) / 111_266.0,
            place.lon_deg - 3.0 * math.sin(yaw) / 78_850.0,
        )
        house.bus.publish(
            "gnss", GnssFix(stamp_ns=state.stamp_ns, position=beside, std_m=3.0), vehicle="ego"
        )
        speed = SpeedSample(stamp_ns=state.stamp_ns + 1, speed_mps=state.speed_mps)
        house.bus.publish("speed", speed, vehicle="ego")
        house.settle()
    intake, told = house.conductor.intake, [event.text for event in house.watched("event")]
    house.tables.close()
    assert intake.latest is not None
    found, real = intake.latest.state, house.states[99]
    frame = LocalFrame(real.position)
    away_m = float(np.hypot(*local_from_geo(frame, found.position.lat_deg, found.position.lon_deg)))

    assert (found.map_shift_m is not None) is helped
    assert (away_m < 2.0) is helped
    assert ("position from GNSS and the map" in told) is helped
    assert intake.record()["position_from"] == (["gnss", "map"] if helped else ["gnss"])
