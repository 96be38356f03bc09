"""Kernels against the plain formula, and that a job finds them compiled."""

from __future__ import annotations

import math
import tempfile
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from foretwin.contracts.arrays import Array
from foretwin.contracts.futures import Future
from foretwin.geometry import compiled as compiled_geometry
from foretwin.geometry.frenet_path import FrenetPath
from foretwin.sim_worker import driver_model as driver
from foretwin.sim_worker.batch import compiled as compiled_nearness
from foretwin.sim_worker.batch.batch_simulation import BatchSimulation
from foretwin.sim_worker.futures.run_job import run_job
from foretwin.sim_worker.metrics import compiled_pairs, compiled_touch
from foretwin.sim_worker.metrics.displacement import cheapest_walks
from foretwin.sim_worker.planner_interface import PlannerOutput, PlannerView
from foretwin.sim_worker.planners import compiled as compiled_pursuit
from foretwin.sim_worker.planners import pure_pursuit_idm as idm
from foretwin.sim_worker.planners import registry
from foretwin.sim_worker.planners.built_in import BUILT_IN
from foretwin.sim_worker.planners.registry import load_planner
from foretwin.sim_worker.planners.tracking import pure_pursuit, turning_speed
from foretwin.sim_worker.road_users import compiled as compiled_leads
from foretwin.sim_worker.vehicle import compiled
from foretwin.sim_worker.vehicle.parameters import load_vehicle
from foretwin.sim_worker.vehicle.reference_points import base_from_cog
from foretwin.sim_worker.vehicle.resistance import resistance_mps2
from tests.sim_worker.places import crossroads, job, turning_path

COVERS = (
    "foretwin.sim_worker.planners.compiled",
    "foretwin.sim_worker.planners.tracking",
    "foretwin.sim_worker.vehicle.compiled",
)

KERNELS: dict[str, Any] = {
    name: kernel
    for module in (
        compiled_geometry,
        compiled,
        compiled_pursuit,
        compiled_pairs,
        compiled_touch,
        compiled_nearness,
        compiled_leads,
    )
    for name, kernel in vars(module).items()
    if hasattr(kernel, "signatures")
}
ARC = np.linspace(0.0, 1.5 * math.pi, 200)
CIRCLE = FrenetPath(20.0 * np.stack([np.sin(ARC), 1.0 - np.cos(ARC)], axis=1))
CAR = load_vehicle()

quick = settings(deadline=None, max_examples=50)


def numbers(shape: int | tuple[int, ...], low: float, high: float) -> st.SearchStrategy[Array]:
    return arrays(np.float64, shape, elements=st.floats(low, high))


class _Dressed:
    """Answers the same numbers, dressed as another package might."""

    def __init__(self, kind: str) -> None:
        self._kind = kind

    def plan(self, view: PlannerView) -> PlannerOutput:
        count = len(view.arc_m)
        accel, angle = np.ones(count), np.zeros(count)
        if self._kind == "strided":
            return PlannerOutput(np.repeat(accel, 2)[::2], np.repeat(angle, 2)[::-2])
        return PlannerOutput(accel.astype(self._kind), angle.astype(self._kind))


def signatures() -> dict[str, list[Any]]:
    return {name: list(kernel.signatures) for name, kernel in KERNELS.items()}


def test_all_is_compiled_once_it_is_imported_and_nothing_later() -> None:
    assert set(KERNELS) == {
        "locate", "curve", "free_road", "forces", "ramp", "read_base", "all_sane", "cheapest_walks",
        "least_until_touch", "find_leaders", "stays_on_strips", "come_near", "least_m", "may_touch",
        "find_overlaps", "least_worst_case", "until_turning_touch", "_apart", "_arc",
        "_relative_at", "find_ahead", "take_nearest", "nearest_in_way", "hide_behind",
        "interpolate",
    }  # fmt: skip
    assert {name: len(found) for name, found in signatures().items()} == dict.fromkeys(KERNELS, 1)
    with pytest.raises(TypeError, match="No matching definition"):
        compiled.all_sane(np.zeros((8, 2), dtype=np.float32), np.ones(8))


def test_a_job_adds_no_signature_whatever_its_planners_answer(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    kinds = ("float64", "float32", "int64", "strided", "pure_pursuit_idm", "constant_speed")
    for kind in kinds[:4]:
        monkeypatch.setitem(registry._OWN, kind, False)
        monkeypatch.setitem(BUILT_IN, kind, lambda kind=kind: _Dressed(kind))
    load_planner.cache_clear()
    stage, before = BatchSimulation(crossroads(), CAR, nsim=8), signatures()
    faulty = {"position_offset_m": 0.1, "friction_factor": 0.8, "brake_gain": 0.9}
    try:
        for numbers in ({}, faulty):
            futures = tuple(
                Future(index=i, name=kind, planner=kind, numbers=numbers)
                for i, kind in enumerate(kinds)
            )
            # One planner alone is asked without its rows being cut out.
            for who in (futures, *((future,) for future in futures)):
                result = run_job(job(who, path=turning_path(), horizon_s=1.0), stage)
                assert result.outcome.valid.all(), result.outcome.failures
                if len(who) > 1:
                    driven = result.trajectory.states
                    assert (driven[1:4] == driven[0]).all()
    finally:
        load_planner.cache_clear()
    assert signatures() == before


def test_where_no_cache_can_be_written_it_is_compiled_for_this_process(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def refuse(**_: object) -> None:
        raise OSError(30, "Read-only file system")

    monkeypatch.setattr(tempfile, "TemporaryFile", refuse)

    @compiled_geometry.kernel(compiled_geometry.REAL, compiled_geometry.REAL)
    def twice(number: float) -> float:
        return 2.0 * number

    assert twice(21.0) == 42.0
    assert twice._cache.cache_path is None  # type: ignore[attr-defined]


@quick
@given(numbers(5, 0.0, 90.0), numbers(5, -8.0, 8.0), numbers(5, -3.0, 3.0))
def test_a_place_is_found_as_by_a_search_of_the_whole_path(
    arc_m: Array, offset_m: Array, off_m: Array
) -> None:
    xy = CIRCLE.point_at(arc_m, offset_m)
    everywhere = CIRCLE.locate(xy)
    nearby = CIRCLE.locate(xy, near_arc_m=everywhere.arc_m + off_m)
    assert nearby.arc_m == pytest.approx(everywhere.arc_m, abs=1e-9)
    assert nearby.offset_m == pytest.approx(everywhere.offset_m, abs=1e-9)


def test_a_place_that_is_no_number_is_nowhere_and_bothers_no_other() -> None:
    xy = np.array([[np.nan, 0.0], [5.0, 0.5], [np.inf, 1.0]])
    found = CIRCLE.locate(xy, near_arc_m=np.array([0.0, 5.0, 5.0]))
    assert np.isnan(found.arc_m).tolist() == [True, False, True]
    assert found.arc_m[1] == pytest.approx(CIRCLE.locate(xy[1:2]).arc_m[0], abs=1e-9)


def view(speed: Array, angle: Array, aside: Array, factor: Array, target: Array) -> PlannerView:
    count = len(speed)
    states = np.zeros((count, 8))
    states[:, :2] = CIRCLE.point_at(np.full(count, 30.0), aside)
    states[:, 2] = CIRCLE.pose_at(np.full(count, 30.0)).yaw_rad
    states[:, 3], states[:, 6] = speed, angle
    place = CIRCLE.locate(states[:, :2], near_arc_m=np.full(count, 30.0))
    return PlannerView(
        time_s=0.0, states=states, path=CIRCLE, arc_m=place.arc_m, offset_m=place.offset_m,
        desired_offset_m=np.full(count, 0.3), target_speed_mps=target, speed_factor=factor,
        lead_gap_m=np.full(count, np.inf), lead_speed_mps=np.zeros(count), vehicle=CAR,
    )  # fmt: skip


@quick
@given(
    numbers(4, 0.0, 20.0), numbers(4, -0.5, 0.5), numbers(4, -2.0, 2.0), numbers(4, 0.5, 1.5),
    numbers(4, 0.2, 20.0),
)  # fmt: skip
def test_curves_and_free_roads_are_driven_by_the_formulas(
    speed: Array, angle: Array, aside: Array, factor: Array, target: Array
) -> None:
    seen = view(speed, angle, aside, factor, target)
    accel, wanted = idm.PurePursuitIdm().plan(seen)

    assert wanted == pytest.approx(pure_pursuit(seen), abs=1e-12)
    profile = CIRCLE.speed_profile(
        lateral_accel_mps2=driver.LATERAL_ACCEL_MPS2, decel_mps2=driver.COMFORT_DECEL_MPS2
    )
    ahead = CIRCLE.at_nodes(profile, seen.arc_m + driver.CURVE_TIME_S * speed)
    turning = turning_speed(seen, wanted, lateral_accel_mps2=idm.TURNING_ACCEL_MPS2)
    curve = (np.minimum(ahead * factor, turning) - speed) / driver.CURVE_TIME_S
    most = driver.MAX_ACCEL_MPS2 * factor
    ratio = speed / target
    slower = driver.COMFORT_DECEL_MPS2 * (
        np.maximum(ratio, 1.0) ** (-most * driver.ACCEL_EXPONENT / driver.COMFORT_DECEL_MPS2) - 1.0
    )
    free = np.where(ratio < 1.0, most * (1.0 - ratio**4), slower)
    expected = np.maximum(np.minimum(curve, free), -driver.MAX_DECEL_MPS2)
    command = expected + resistance_mps2(CAR, speed)
    command = np.where((speed < driver.HOLD_SPEED_MPS) & (expected <= 0), driver.HOLD_MPS2, command)
    assert accel == pytest.approx(command, abs=1e-9)


@quick
@given(numbers(3, -9.0, 9.0), numbers(3, -30.0, 30.0), numbers(3, 1.0, 10.0))
def test_forces_are_those_of_the_friction_circle(accel: Array, speed: Array, grip: Array) -> None:
    mass, rolling, drag, least_kg, least_mps = constants = (1500.0, 150.0, 0.4, 1e-9, 1.0)
    gear, square = np.array([1.0, -1.0, 1.0]), grip**2
    transfer = np.repeat([[-80.0], [80.0]], 3, axis=1)
    axles = np.repeat([[800.0], [700.0]], 3, axis=1)
    stiffness = np.repeat([[-90.0], [-110.0]], 3, axis=1)
    damping, low, high = (np.empty((2, 3)) for _ in range(3))
    drive, along = np.empty((4, 3)), np.empty((2, 3))

    compiled.forces(
        accel, speed, square, 0.01 * square, transfer, axles, stiffness, constants, gear,
        damping, low, high, drive, along[0], along[1],
    )  # fmt: skip

    load = np.maximum(axles + transfer * accel * gear, least_kg)
    across = load * np.sqrt(np.maximum(square - accel**2, 0.01 * square))
    assert high == pytest.approx(across)
    assert low == pytest.approx(-across)
    assert damping == pytest.approx(stiffness * load / np.maximum(np.abs(speed), least_mps))
    pull = np.maximum(mass * accel, 0.0) * gear - drag * speed * np.abs(speed)
    brake = np.maximum(-mass * accel, 0.0) + rolling
    assert drive == pytest.approx(np.tile(pull, (4, 1)))
    assert along == pytest.approx(np.stack([pull - brake, pull + brake]))


@quick
@given(numbers(4, -0.6, 0.6), numbers(4, -0.6, 0.6), st.floats(0.0, 0.1))
def test_wheels_turn_no_faster_than_they_can(angle: Array, command: Array, step: float) -> None:
    steer, kept = np.empty((5, 4)), command.copy()
    compiled.ramp(angle, kept, step, steer)
    reach = step * np.arange(1.0, 6.0)[:, None]
    assert steer == pytest.approx(command + np.clip(angle - command, -reach, reach), abs=1e-15)
    assert (kept == steer[-1]).all()


@quick
@given(numbers((8, 3), -50.0, 50.0), numbers(3, 0.0, 20.0))
def test_states_are_read_from_joints(joints: Array, before: Array) -> None:
    states, heading = np.zeros((8, 3)), np.empty((2, 3))
    states[3] = before
    compiled.read_base(joints, CAR.cog_from_rear_axle_m.value, 0.02, states, heading)
    expected = base_from_cog(CAR, joints[:4].T, joints[4:].T, np.zeros((3, 8)))
    assert states[:7] == pytest.approx(expected.T[:7], abs=1e-9)
    assert states[7] == pytest.approx((states[3] - before) / 0.02)
    assert heading == pytest.approx(np.stack([np.cos(joints[2]), np.sin(joints[2])]), abs=1e-12)


@quick
@given(arrays(np.float64, (8, 3), elements=st.floats(allow_nan=True, allow_infinity=True)))
def test_sane_is_what_is_a_number_within_bounds(states: Array) -> None:
    most = np.array([np.inf, np.inf, np.inf, 200.0, np.inf, 50.0, np.inf, np.inf])
    assert compiled.all_sane(states, most) == bool((np.abs(states) < most[:, None]).all())


@settings(deadline=None, max_examples=20)
@given(numbers((2, 4, 2), -30.0, 30.0), numbers((3, 2), -30.0, 30.0))
def test_walks_along_two_curves_are_the_cheapest(curves: Array, reference: Array) -> None:
    def cheapest(curve: Array, i: int, j: int, warped: bool) -> float:
        away = float(np.hypot(*(curve[i] - reference[j])))
        before = [
            cheapest(curve, *pair, warped)
            for pair in ((i - 1, j), (i, j - 1), (i - 1, j - 1))
            if min(pair) >= 0
        ]
        least = min(before, default=0.0)
        return least + away if warped else max(least, away)

    furthest, sums = cheapest_walks(curves, reference)
    assert furthest == pytest.approx([cheapest(curve, 3, 2, False) for curve in curves], abs=1e-12)
    assert sums == pytest.approx([cheapest(curve, 3, 2, True) for curve in curves], abs=1e-12)
    whole = cheapest_walks(np.float32(curves), np.float32(reference))
    assert whole[0] == pytest.approx(furthest, abs=1e-4)
