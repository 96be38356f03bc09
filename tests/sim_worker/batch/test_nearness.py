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
from foretwin.contracts.vehicle import VehicleParameters
from foretwin.sim_worker.batch.batch_simulation import BatchSimulation, Controls
from foretwin.sim_worker.batch.compiled import CELL_M, FAR, STEP_M
from foretwin.sim_worker.batch.nearness import CarBox, NearStatics, most_drift_m
from foretwin.sim_worker.futures.future_mix import plan_futures
from foretwin.sim_worker.futures.result_digest import result_digest
from foretwin.sim_worker.futures.run_job import run_job
from foretwin.sim_worker.scenarios.reading import catalogue
from foretwin.sim_worker.vehicle.parameters import load_vehicle
from foretwin.sim_worker.vehicle.reference_points import cog_from_base
from tests.sim_worker.driving import altered, seed
from tests.sim_worker.places import box, crossroads, job, state_at

COVERS = ("foretwin.sim_worker.batch.compiled",)

CAR = load_vehicle()
HAPPENINGS = tuple(catalogue()[name] for name in ("scp", "cccscp", "lead_stopping"))


def _turned(x: float, y: float, yaw: float, name: str) -> Building:
    cos, sin = math.cos(yaw), math.sin(yaw)
    corners = np.array([[-6.0, -2.0], [6.0, -2.0], [6.0, 2.0], [-6.0, 2.0]])
    outline = corners @ np.array([[cos, sin], [-sin, cos]]) + (x, y)
    return Building(id=name, outline=outline, holes=(), height_m=Quantity(8.0, "default"))


HOUSES = (_turned(20.0, 12.0, 0.7, "a"), _turned(-30.0, -11.0, -0.3, "b"), box(3, 15, 4, 4, "c"))
POST = box(-8.0, -9.0, 0.15, 0.15, "post")
TOWN = crossroads(buildings=(*HOUSES, POST))
STAGE = BatchSimulation(TOWN, CAR, nsim=64)
LORRY = altered(
    CAR, length_m=12.0, width_m=2.5, rear_overhang_m=3.0, wheelbase_m=6.0, mass_kg=9000.0,
    cog_from_rear_axle_m=2.5, cog_height_m=1.2, yaw_inertia_kgm2=9e4,
)  # fmt: skip
STAGES = (STAGE, BatchSimulation(TOWN, LORRY, nsim=64, control_hz=10.0))
OUTLINES = [shapely.Polygon(house.outline) for house in TOWN.buildings]
FAR_M = FAR * STEP_M


@settings(deadline=None, max_examples=300)
@given(st.floats(-60.0, 60.0), st.floats(-30.0, 30.0))
def test_nothing_is_nearer_than_the_grid_says_and_hardly_farther(x: float, y: float) -> None:
    away = min(outline.distance(shapely.Point(x, y)) for outline in OUTLINES)
    least = NearStatics(STAGE.model).least_m(x, y)
    assert least <= away + 1e-6
    assert least >= min(away - math.sqrt(2.0) * CELL_M - STEP_M, FAR_M)


def test_places_outside_the_grid_and_no_places_at_all() -> None:
    near, bare = (NearStatics(one.model) for one in (STAGE, BatchSimulation(None, CAR, nsim=1)))
    for x, y in ((-1e9, 0.0), (1e9, 0.0), (0.0, -1e9), (0.0, 1e9)):
        assert near.least_m(x, y) == bare.least_m(x, y) == FAR_M
    for place in (math.nan, math.inf):
        assert near.least_m(place, 0.0) == near.least_m(0.0, place) == 0.0
    assert bare.empty
    assert not near.empty


def _in_motion(stage: BatchSimulation, rng: np.random.Generator) -> Array:
    """Cars that move in every way."""
    states = np.zeros((stage.nsim, 8))
    states[:, 2] = rng.uniform(-math.pi, math.pi, stage.nsim)
    states[:, 3] = rng.uniform(-10.0, 40.0, stage.nsim) * rng.integers(2, size=stage.nsim)
    states[:, 4] = rng.uniform(-15.0, 15.0, stage.nsim) * rng.integers(2, size=stage.nsim)
    states[:, 5] = rng.uniform(-3.0, 3.0, stage.nsim) * rng.integers(2, size=stage.nsim)
    states[:, 6] = rng.uniform(-0.5, 0.5, stage.nsim)
    return states


def _close_by(stage: BatchSimulation, rng: np.random.Generator) -> Array:
    """Cars in motion, each at most about its length from something static."""
    states, reach_m = _in_motion(stage, rng), stage.vehicle.length_m.value
    about = np.concatenate([house.outline for house in TOWN.buildings])
    states[:, :2] = about[rng.integers(len(about), size=stage.nsim)]
    states[:, :2] += rng.uniform(-reach_m, reach_m, (stage.nsim, 2))
    return states


@pytest.mark.parametrize("stage", STAGES, ids=["car", "lorry"])
def test_where_a_contact_follows_within_a_tick_contacts_are_looked_for(
    stage: BatchSimulation,
) -> None:
    """Beside a thorough twin, which looks everywhere and so finds all contacts."""
    rng = np.random.default_rng(3)
    hit = by_little = 0
    for _ in range(60):
        states, friction = _close_by(stage, rng), rng.choice([0.1, 1.0, 4.0], stage.nsim)
        seed(stage, states, friction=friction)
        near = stage._near_statics_of(stage._live.T)
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(stage, "_near_statics_of", _always)
            accel = rng.choice([-40.0, 0.0, 40.0], stage.nsim)
            stage.step(Controls(accel, rng.uniform(-0.6, 0.6, stage.nsim)))
        assert not (stage.static_contact & ~near).any()
        hit += int(stage.static_contact.sum())
        by_little += int((near & ~stage.static_contact).sum())
    assert hit > 500
    assert by_little < hit, "most of those who need no look get none"


@pytest.mark.parametrize(("vehicle", "control_hz"), [(CAR, 20.0), (CAR, 100.0), (LORRY, 10.0)])
def test_no_corner_drifts_farther_within_a_tick_than_the_bound_and_some_a_third_as_far(
    vehicle: VehicleParameters, control_hz: float
) -> None:
    stage = BatchSimulation(None, vehicle, nsim=512, control_hz=control_hz)
    tick_s, rng = stage.control_dt_s, np.random.default_rng(5)
    car, half_m = CarBox.of(vehicle, tick_s=tick_s), np.array([1.0, -1.0])
    lengths = car.ahead_m - car.cog_ahead_m + car.half_length_m * half_m
    corners = np.array([[x, y] for x in lengths for y in car.half_width_m * half_m])
    most = 0.0
    for _ in range(20):
        states, friction = _in_motion(stage, rng), rng.choice([0.3, 1.0, 4.0], stage.nsim)
        seed(stage, states, friction=friction)
        places, velocities = cog_from_base(vehicle, states)
        aim = rng.uniform(-40.0, 40.0, stage.nsim), rng.uniform(-0.6, 0.6, stage.nsim)
        stage.step(Controls(*aim))
        now, _ = cog_from_base(vehicle, stage.states)
        coasting = _corners(places + velocities * tick_s, corners)
        drift = np.hypot(*np.moveaxis(_corners(now, corners) - coasting, -1, 0)).max(axis=1)
        share = drift / most_drift_m(vehicle, friction, car)
        most = max(most, float(share.max()))
    assert 0.3 < most <= 1.0


def _corners(places: Array, corners: Array) -> Array:
    """Return (S, 4, 2) where corners (4, 2) of cars are, whose joints are `places` (S, 4)."""
    cos, sin = np.cos(places[:, 2]), np.sin(places[:, 2])
    turned = np.array([[cos, sin], [-sin, cos]]).transpose(2, 0, 1)
    return np.asarray(places[:, None, :2] + corners @ turned)


@settings(deadline=None, max_examples=100)
@given(st.floats(0.0, 40.0), st.floats(1.0, 5.0), st.booleans())
def test_who_drives_along_a_wall_needs_no_look_and_who_drives_against_it_does(
    speed_mps: float, x: float, back: bool
) -> None:
    """A metre beside it, and as far before it as the car comes within a tick."""
    wall_m, yaw = OUTLINES[2].bounds[1], math.pi if back else 0.0
    front_m = CAR.length_m.value - CAR.rear_overhang_m.value
    clear_m, tick_m = wall_m - CAR.width_m.value / 2.0, speed_mps / 20.0
    beside = x, clear_m - 1.0, yaw, speed_mps, 0.0, 0.0, 0.0, 0.0
    before = 3.0, wall_m - front_m - tick_m, math.pi / 2.0, speed_mps, 0.0, 0.0, 0.0, 0.0
    sliding = x, clear_m - tick_m, 0.0, 0.0, speed_mps, 0.0, 0.0, 0.0
    seed(STAGE, np.array([beside, before, sliding]))
    assert STAGE._near_statics_of(STAGE._live.T).tolist() == [False, True, True]
    drifting = STAGE._near_statics.may_touch(
        STAGE._box, STAGE._live.T, STAGE.heading, np.array([1.0, 0.0, 0.0])
    )
    assert drifting.tolist() == [True, True, True]


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
