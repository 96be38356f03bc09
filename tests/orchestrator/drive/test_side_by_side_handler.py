"""A human drives while the software plans: what a drive tells, publishes and records of it."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest

from foretwin.contracts.drive import ControlMode, PlannedTrajectory, VehicleStatus
from foretwin.contracts.frames import geo_from_local, local_from_geo
from foretwin.orchestrator.drive.side_by_side_handler import disagreement_text
from tests.orchestrator.house import House
from tests.orchestrator.trip import town


@pytest.fixture
def house(tmp_path: Path) -> Iterator[House]:
    made = House(tmp_path)
    yield made
    made.tables.close()


def plan_of(house: House, number: int, *, left_m: float) -> PlannedTrajectory:
    """What will be driven in the next 5 s, moved to the left."""
    frame, ahead = town().graph.frame, house.states[number : number + 51 : 2]
    lat = np.array([state.position.lat_deg for state in ahead])
    lon = np.array([state.position.lon_deg for state in ahead])
    yaw = np.array([state.yaw_rad for state in ahead])
    left = np.column_stack([-np.sin(yaw), np.cos(yaw)])
    geo = geo_from_local(frame, local_from_geo(frame, lat, lon) + left_m * left)
    return PlannedTrajectory(
        stamp_ns=ahead[0].stamp_ns, time_from_stamp_s=0.2 * np.arange(len(ahead)),
        lat_deg=geo[:, 0].copy(), lon_deg=geo[:, 1].copy(), yaw_rad=yaw,
        speed_mps=np.full(len(ahead), 10.0),
    )  # fmt: skip


def drive(house: House, modes: dict[int, ControlMode], *, shifted: range, left_m: float) -> None:
    for number in range(120):
        stamp_ns = house.states[number].stamp_ns
        if number in modes:
            status = VehicleStatus(stamp_ns=stamp_ns, control_mode=modes[number])
            house.bus.publish("status", status, vehicle="ego")
        plan = plan_of(house, number, left_m=left_m if number in shifted else 0.0)
        house.bus.publish("plan", plan, vehicle="ego")
        house.drive(number + 1, working=False)
    house.end()


def test_another_lane_of_the_software_is_listed_with_its_place(house: House) -> None:
    house.bus.subscribe("disagreement", house.seen, run=house.plan.run_id)
    drive(house, {0: "manual"}, shifted=range(60, 90), left_m=3.5)

    record = house.conductor.ads.record()
    assert record is not None
    found = [one for one in record["disagreements"] if one["drive_time_s"] > 3.0]
    (one,) = found  # before, the heading is not known well yet
    assert one["kind"] == "ads_in_another_lane"
    assert one["drive_time_s"] == pytest.approx(6.0, abs=0.3)
    assert one["duration_s"] == pytest.approx(3.0, abs=0.5)
    assert one["lateral_m"] == pytest.approx(3.5, abs=0.5)
    assert one["route_m"] == pytest.approx(60.0, abs=10.0)
    assert one["junction_id"] == "n4"
    here = house.states[60].position
    assert one["lat_deg"] == pytest.approx(here.lat_deg, abs=5e-5)
    assert one["lon_deg"] == pytest.approx(here.lon_deg, abs=5e-5)

    published = [p for p in house.watched("disagreement") if p.kind == one["kind"]]
    assert [p.over for p in published[-2:]] == [False, True]
    text = disagreement_text(published[-1], "Mill Lane \u00d7 High Street")
    assert "the ADS would have taken another lane" in text
    assert ", at or before Mill Lane \u00d7 High Street" in text
    results = house.plan.folder / "results"
    row = pq.read_table(results / "disagreements.parquet").to_pylist()[-1]
    assert row.items() <= one.items()
    (segment,) = pq.read_table(results / "driven_segments.parquet").to_pylist()
    assert segment == record["segments"][0]
    assert segment["control_mode"] == "manual"


def test_a_takeover_parts_what_is_compared(house: House) -> None:
    drive(house, {0: "autonomous", 60: "manual"}, shifted=range(30, 60), left_m=3.5)
    record = house.conductor.ads.record()
    assert record is not None
    software, human = record["segments"]
    assert (software["control_mode"], human["control_mode"]) == ("autonomous", "manual")
    assert software["to_stamp_ns"] == human["from_stamp_ns"] == house.states[60].stamp_ns
    assert software["lateral_m"] == pytest.approx(3.5, abs=0.5)
    assert human["lateral_m"] < 1.0
    assert record["disagreements"] == []


def test_a_drive_without_plans_has_nothing_beside_it(house: House) -> None:
    house.drive(20, working=False)
    house.end()
    assert house.conductor.ads.record() is None
