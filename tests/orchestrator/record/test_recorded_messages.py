"""States and detections of a recording, read without its sensors."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import msgspec
import pytest

from foretwin.contracts.drive import GnssFix, RoadUsers, VehicleInfo, VehicleState
from foretwin.contracts.frames import GeoPoint
from foretwin.orchestrator.record import recorded_messages as module
from foretwin.orchestrator.record.recorded_messages import (
    OBJECTS,
    STATES,
    TopicRead,
    car_recorded,
    recorded_messages,
)
from foretwin.telemetry.logs.mcap_records import Contents, Record
from foretwin.telemetry.logs.write_mcap import create

HERE = GeoPoint(52.5, 13.4)
INFO = VehicleInfo(
    vehicle_id="ego", time_base="relative", start_stamp_ns=0, end_stamp_ns=10**9, source="a test",
    sends=("gnss", "objects"),
)  # fmt: skip


def state(stamp_ns: int) -> VehicleState:
    return VehicleState(
        vehicle_id="ego", stamp_ns=stamp_ns, position=HERE, yaw_rad=0.0, speed_mps=8.0,
        yaw_rate_radps=0.0, accel_mps2=0.0,
    )  # fmt: skip


def recording(folder: Path) -> Path:
    file = folder / "drive.mcap"
    with create(file, info=INFO) as writer:
        for stamp_ns in range(0, 500_000_000, 20_000_000):
            writer.add("gnss", GnssFix(stamp_ns=stamp_ns, position=HERE))
            writer.add("state", state(stamp_ns))
        writer.add("objects", RoadUsers(stamp_ns=500_000_000, users=()))
    return file


def test_states_are_read_as_they_were_estimated_and_thinned(tmp_path: Path) -> None:
    file = recording(tmp_path)

    assert list(recorded_messages(file, TopicRead(STATES, VehicleState))) == [
        state(stamp_ns) for stamp_ns in range(0, 500_000_000, 20_000_000)
    ]
    thinned = recorded_messages(file, TopicRead(STATES, VehicleState, 100_000_000))
    assert [one.stamp_ns for one in thinned] == [n * 100_000_000 for n in range(5)]


def test_what_the_guard_refuses_is_passed_by(tmp_path: Path) -> None:
    file = tmp_path / "drive.mcap"
    odd = msgspec.structs.replace(state(1), position=GeoPoint(952.5, 13.4))
    with create(file, info=INFO) as writer:
        for one in (state(0), odd, state(2)):
            writer.add("state", one)

    assert list(recorded_messages(file, TopicRead(STATES, VehicleState))) == [state(0), state(2)]


def test_another_topic_has_its_own_messages_and_a_missing_file_none(tmp_path: Path) -> None:
    told = list(recorded_messages(recording(tmp_path), TopicRead(OBJECTS, RoadUsers)))

    assert told == [RoadUsers(stamp_ns=500_000_000, users=())]
    assert list(recorded_messages(tmp_path / "none.mcap", TopicRead(STATES, VehicleState))) == []


def test_what_breaks_off_is_read_as_far_as_it_goes(tmp_path: Path) -> None:
    file = recording(tmp_path)
    file.write_bytes(file.read_bytes()[:-200])

    assert len(list(recorded_messages(file, TopicRead(STATES, VehicleState)))) in range(26)


def test_what_is_recorded_of_a_car_is_read_in_one_walk(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    file = recording(tmp_path)
    walks: list[set[str]] = []
    records = module.records

    def counted(part: Path, contents: Contents, topics: set[str]) -> Iterator[Record]:
        walks.append(topics)
        return records(part, contents, topics)

    monkeypatch.setattr(module, "records", counted)

    states, objects = car_recorded(file)

    assert walks == [{STATES, OBJECTS}]
    assert [one.stamp_ns for one in states] == [n * 100_000_000 for n in range(5)]
    assert objects == (RoadUsers(stamp_ns=500_000_000, users=()),)


def test_a_topic_that_breaks_off_takes_no_other_along(tmp_path: Path) -> None:
    file = recording(tmp_path)

    topics = TopicRead(STATES, RoadUsers), TopicRead(OBJECTS, RoadUsers)

    assert list(recorded_messages(file, *topics)) == [RoadUsers(stamp_ns=500_000_000, users=())]
