from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st

from foretwin.contracts.arrays import Array
from foretwin.contracts.beside_road import Building
from foretwin.contracts.futures import Future
from foretwin.contracts.provenance import Quantity
from foretwin.sim_worker.batch.batch_simulation import BatchSimulation
from foretwin.sim_worker.batch.nearness import NearStatics
from foretwin.sim_worker.futures.future_mix import plan_futures
from foretwin.sim_worker.futures.run_job import result_digest, run_job
from foretwin.sim_worker.scenarios.reading import catalogue
from foretwin.sim_worker.vehicle.parameters import load_vehicle
from tests.sim_worker.places import box, crossroads, job, state_at

CAR = load_vehicle()
REACH_M = 3.0
HAPPENINGS = tuple(catalogue()[name] for name in ("scp", "cccscp", "lead_stopping"))


def _turned(x: float, y: float, yaw: float, name: str) -> Building:
    cos, sin = math.cos(yaw), math.sin(yaw)
    corners = np.array([[-6.0, -2.0], [6.0, -2.0], [6.0, 2.0], [-6.0, 2.0]])
    outline = corners @ np.array([[cos, sin], [-sin, cos]]) + (x, y)
    return Building(id=name, outline=outline, holes=(), height_m=Quantity(8.0, "default"))


HOUSES = (_turned(20.0, 12.0, 0.7, "a"), _turned(-30.0, -11.0, -0.3, "b"), box(3, 15, 4, 4, "c"))
STAGE = BatchSimulation(crossroads(buildings=HOUSES), CAR, nsim=64)
NEAR = NearStatics(STAGE.model, reach_m=REACH_M)


@settings(deadline=None, max_examples=300)
@given(st.floats(-60.0, 60.0), st.floats(-30.0, 30.0))
def test_whatever_is_in_reach_is_near_and_what_is_far_is_not(x: float, y: float) -> None:
    point = shapely.Point(x, y)
    distance = min(shapely.Polygon(house.outline).distance(point) for house in HOUSES)
    near = bool(NEAR.at(np.array([[x], [y]]))[0])
    if distance <= REACH_M:
        assert near
    # A point off a corner is nearer to both lines than to the corner.
    if distance > math.sqrt(2.0) * (REACH_M + math.sqrt(0.5)) + math.sqrt(0.5):
        assert not near


def test_places_outside_the_grid_and_no_places_at_all_are_far() -> None:
    places = np.array([-1e9, 1e9, np.nan, np.inf, 0.0])
    assert not NEAR.at(np.stack([places, places[::-1]])).any()
    assert (
        not NearStatics(BatchSimulation(None, CAR, nsim=1).model, reach_m=5.0)
        .at(np.stack([places, places]))
        .any()
    )


def _always(columns: Array) -> Any:
    return np.ones(columns.shape[1], dtype=bool)


@pytest.mark.parametrize("planner", ["pure_pursuit_idm", "constant_speed"])
def test_looking_for_contacts_only_where_there_can_be_some_changes_no_bit(
    monkeypatch: pytest.MonkeyPatch, planner: str
) -> None:
    heading = (0.0, 0.25, -0.4)
    futures = plan_futures(count=63, seed=5, planners=[planner], scenarios=HAPPENINGS)
    jobs = [
        job((*futures, Future(index=63, name="x", planner=planner)), cruise=cruise,
            state=state_at(-45.0, -1.5, yaw, cruise))
        for yaw, cruise in zip(heading, (8.0, 14.0, 27.0), strict=True)
    ]  # fmt: skip
    sparing = [run_job(question, STAGE) for question in jobs]
    assert {0, 1, 2} <= set(np.concatenate([r.outcome.collision_with for r in sparing]))
    monkeypatch.setattr(STAGE, "_near_statics_of", _always)
    thorough = [run_job(question, STAGE) for question in jobs]
    assert list(map(result_digest, sparing)) == list(map(result_digest, thorough))
