"""Attributes of the operational design domain of a drawn drive, and triggering conditions."""

from __future__ import annotations

import msgspec
import numpy as np
import pytest

from foretwin.contracts.drive import VehicleState
from foretwin.contracts.frames import GeoPoint
from foretwin.sim_worker.analysis.occurred.odd import NOT_TOLD, OddExposure, driven_in, odd_of
from foretwin.sim_worker.analysis.occurred.roads import Roads
from foretwin.sim_worker.analysis.occurred.scene import STEP_S, DrivenMotion, courses_of
from foretwin.sim_worker.analysis.occurred.triggering import triggering_conditions
from tests.sim_worker.analysis.occurred.scenes import (
    START_NS,
    ego_eastwards,
    moving,
    seen_in,
)
from tests.sim_worker.scenarios.worlds import cross

COVERS = ("foretwin.sim_worker.analysis.occurred.triggering",)
BERLIN = GeoPoint(52.5, 13.4)


def exposures(*, utc: bool = True, sees_others: bool = True) -> list[OddExposure]:
    """A drive of 16 s at 8 m/s over the drawn crossing, with one oncoming car."""
    ego = ego_eastwards(16.1)
    world, oncoming = cross(), moving("o", (0.0, 1.8), (-9.0, 0.0), 10.0, seconds=16.1)
    return list(
        odd_of(
            ego,
            courses_of([oncoming], ego),
            Roads([world], world.frame),
            seen_in(ego),
            where=BERLIN,
            utc=utc,
            sees_others=sees_others,
        )
    )


def of(rows: list[OddExposure], attribute: str) -> dict[str, OddExposure]:
    return {row.value: row for row in rows if row.attribute == attribute}


def test_every_attribute_is_exposed_over_the_whole_drive() -> None:
    rows = exposures()
    names = {row.attribute for row in rows} - {"SceneryJunction kind", "SceneryJunction control"}
    for name in names:
        told = of(rows, name).values()
        assert sum(row.driven_m for row in told) == pytest.approx(16.0 * 8.0, abs=1e-6)
        assert sum(row.driven_s for row in told) == pytest.approx(16.1, abs=1e-6)


def test_what_was_driven_in_some_of_the_time_is_told_once() -> None:
    ego = ego_eastwards(16.1)
    at = [int(ego.stamp_ns[row]) for row in (0, 20, 10, 50, 120, 130)]

    found = driven_in(ego, [(at[0], at[1]), (at[2], at[3]), (at[4], at[5])])

    assert found.driven_s == pytest.approx(60 * STEP_S)
    assert found.driven_m == pytest.approx(60 * STEP_S * 8.0)
    assert driven_in(ego, []).driven_m == 0.0


def test_roads_junctions_and_others_are_told_by_map_and_detections() -> None:
    rows = exposures()

    road = of(rows, "DrivableAreaType")
    assert set(road) == {"RoadTypeMinor", "JunctionIntersection"}
    assert road["JunctionIntersection"].driven_m == pytest.approx(14.0, abs=6.0)
    assert of(rows, "SceneryJunction kind")["IntersectionCrossroad"].junctions == 1
    assert set(of(rows, "LaneSpecificationLaneCount")) == {"2"}
    assert "50 km/h" in of(rows, "SpeedLimit")
    assert of(rows, "SubjectVehicleSpeed").keys() == {"1 to 30 km/h"}
    # Both near each other at 17 m/s: nearer than 50 m for 5.9 s.
    near = of(rows, "TrafficAgentDensity")["1 to 3 within 50 m"]
    assert near.driven_s == pytest.approx(5.9, abs=0.4)


def test_what_nobody_told_is_unknown() -> None:
    rows = exposures(utc=False, sees_others=False)

    for name in (*NOT_TOLD, "EnvironmentIllumination", "TrafficAgentDensity"):
        assert of(rows, name).keys() == {"unknown"}
    # In 1970, at five seconds past midnight.
    assert of(exposures(), "EnvironmentIllumination").keys() == {"LowLightNight"}


def states(ego: DrivenMotion) -> list[VehicleState]:
    return [
        VehicleState(
            vehicle_id="car",
            stamp_ns=int(stamp),
            position=BERLIN,
            yaw_rad=0.0,
            speed_mps=8.0,
            yaw_rate_radps=0.0,
            accel_mps2=0.0,
            position_std_m=0.02,
        )
        for stamp in ego.stamp_ns
    ]


def test_a_good_drive_triggers_nothing() -> None:
    ego = ego_eastwards()

    assert triggering_conditions(states(ego), ego, ego.stamp_ns) == ()


def test_poor_positions_standing_telemetry_holes_and_lost_detections_are_told() -> None:
    ego, told = ego_eastwards(), states(ego_eastwards())
    for row in range(30, 50):
        told[row] = msgspec.structs.replace(told[row], position_std_m=2.5)
    for row in range(60, 80):
        told[row] = msgspec.structs.replace(told[row], stale=("gnss",))
    told[90] = msgspec.structs.replace(told[90], stale=("imu",))  # a moment alone
    hole = ego._replace(xy_m=np.where(np.arange(180)[:, None] // 15 == 7, np.nan, ego.xy_m))
    heard = np.delete(ego.stamp_ns, np.arange(130, 150))

    found = triggering_conditions(told, hole, heard)

    assert [(one.kind, round((one.begin_ns - START_NS) * 1e-9, 1)) for one in found] == [
        ("poor_position", 3.0),
        ("stale_telemetry", 6.0),
        ("no_state", 10.5),
        ("lost_detections", 12.9),
    ]
    assert found[1].detail == "gnss"
    assert found[3].detail == "no detections told for 2.1 s"
