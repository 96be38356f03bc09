"""Rows of the tables and what those who watch receive."""

from __future__ import annotations

import math

import numpy as np
import pytest

from foretwin.contracts.gap import Verdict
from foretwin.contracts.simulation import MirroredVehicle, PlaneState, TwinCorrection
from foretwin.orchestrator.record.result_rows import (
    plan_row,
    round_futures,
    round_row,
)
from foretwin.orchestrator.record.results import MIRROR, MIRRORED, TABLES
from foretwin.orchestrator.rounds.views import round_view
from foretwin.sim_worker.futures.columns import columns, columns_of, row_of
from foretwin.sim_worker.futures.likelihood import NEAR_MISS
from foretwin.sim_worker.vehicle.parameters import load_vehicle
from tests.contracts.mirror_samples import mirror_sample
from tests.orchestrator.futures_rounds import round_done, straight
from tests.orchestrator.trip import START_NS, town_world
from tests.viewer.scene import drive

COVERS = ("foretwin.sim_worker.futures.columns",)
WORLD = town_world("n4")


def test_each_future_is_a_row_with_its_difference_from_the_nominal() -> None:
    done = round_done(straight(), np.concatenate([straight((0.0, 2.0)), straight(speed_mps=9.0)]))
    _, rows, distinct = round_futures(done)

    assert [row["name"] for row in rows] == ["nominal", "future 1", "future 2"]
    assert [row["worker_id"] for row in rows] == ["w0", "w1", "w1"]
    ends = [row["end_difference_from_nominal_m"] for row in rows]
    assert ends == pytest.approx([0.0, 2.0, 8.0], abs=1e-4)
    assert distinct == 3
    assert [row["end_speed_mps"] for row in rows] == pytest.approx([10.0, 10.0, 9.0])


def test_futures_within_a_hand_of_each_other_are_not_distinct() -> None:
    near = np.concatenate([straight(), straight((0.0, 0.05)), straight((0.0, 0.5))])

    assert round_futures(round_done(near)).distinct == 2


def test_a_future_that_diverged_counts_as_no_distinct_one() -> None:
    wild = np.concatenate([straight(), straight((0.0, 50.0))])
    done = round_done(wild, outcome={"valid": np.array([True, False])})
    _, rows, distinct = round_futures(done)

    assert distinct == 1
    assert [row["valid"] for row in rows] == [True, False]


def test_what_did_not_happen_is_null_and_not_a_number() -> None:
    _, (row,), _ = round_futures(round_done(straight()))

    assert (row["collision_time_s"], row["min_clearance_m"]) == (None, None)
    assert row["progress_m"] == 80.0


def test_rows_have_the_columns_of_their_tables() -> None:
    done = round_done(straight())
    _, (future,), _ = round_futures(done)
    row = round_row(
        done, start_stamp_ns=START_NS - 10**9, distinct=1, sha256="ab", cruise_speed_mps=9.5
    )
    watched = {message.channel: message.message for message in drive(duration_s=1.0)}

    assert set(future) <= set(TABLES["futures"].names)
    assert set(row) == set(TABLES["rounds"].names)
    assert (row["drive_time_s"], row["futures"]) == (1.0, 1)
    assert set(row_of(watched["comparison"])) == set(TABLES["comparisons"].names)
    assert set(plan_row(watched["plan_comparison"])) == set(TABLES["plan_comparisons"].names)
    assert set(row_of(watched["mirror"], MIRROR)) == set(TABLES["mirror"].names)


def test_a_mirror_row_keeps_who_is_who() -> None:
    poses = {
        who: PlaneState(float(n), 0.0, 0.0, 0.0)
        for n, who in enumerate(("real", "twin", "shadow", "ghost"))
    }
    sample = mirror_sample(
        1, poses["real"], gap_m=1.0, gap_along_m=1.0, since_reset_s=2.0, independent=False, **poses
    )
    row = row_of(sample, MIRROR)

    assert [row[f"{who}_x_m"] for who in poses] == [0.0, 1.0, 2.0, 3.0]
    assert (row["role"], row["free_x_m"], row["correction_along_mps2"]) == ("all", None, None)


def test_a_vehicle_beside_has_a_row_of_its_own() -> None:
    here = PlaneState(1.0, 2.0, 0.0, 3.0)
    other = MirroredVehicle(
        vehicle_id="van", role="twin", real=here, shown=here, length_m=4.5, width_m=1.8,
        height_m=2.0, rear_overhang_m=0.9,
        correction=TwinCorrection(along_mps2=0.5, across_mps2=0.0, yaw_radps2=0.0),
    )  # fmt: skip
    row = row_of(other, MIRRORED)
    assert {"stamp_ns", *row} == set(TABLES["mirrored"].names)
    assert (row["role"], row["shown_y_m"], row["correction_along_mps2"]) == ("twin", 2.0, 0.5)


def test_columns_are_those_of_a_message_and_of_what_is_in_it() -> None:
    assert columns_of(MirroredVehicle, "role real") == columns(
        "role:str real_x_m:float real_y_m:float real_yaw_rad:float real_speed_mps:float"
    )
    assert list(columns_of(Verdict))[-2:] == ["evidence", "confidence"]


def view_of(**outcome: np.ndarray):
    states = np.concatenate([straight((0.0, float(y))) for y in range(4)])
    done = round_done(states, outcome=outcome)
    return round_view(done, round_futures(done).futures, WORLD, load_vehicle(), WORLD.frame)


def test_criticality_grows_as_clearance_shrinks_and_is_most_in_a_collision() -> None:
    view = view_of(
        collided=np.array([False, False, False, True]),
        collision_with=np.array([0, 0, 0, 2]),
        collision_time_s=np.array([math.nan, math.nan, math.nan, 2.0]),
        min_clearance_m=np.array([math.nan, 20.0, 1.0, 0.0]),
    )

    nothing, far, near, hit = view.criticality.tolist()
    assert (nothing, far, near) == pytest.approx((0.0, 0.0, 0.5 * NEAR_MISS))
    assert hit >= NEAR_MISS
    assert (view.collided, view.min_clearance_m) == (1, 0.0)


def test_a_near_miss_is_no_collision() -> None:
    view = view_of(min_clearance_m=np.array([math.nan, 20.0, 5.0, 0.01]))

    assert view.criticality.max() < NEAR_MISS
    assert view.collided == 0


def test_without_anybody_else_there_is_no_clearance() -> None:
    assert view_of().min_clearance_m is None


def test_a_view_has_fewer_points_from_first_to_last() -> None:
    view = view_of()

    assert view.xy_m.shape == (4, 25, 2)
    assert view.xy_m[0, 0] == pytest.approx([0.0, 0.0], abs=1e-3)
    assert view.xy_m[0, -1] == pytest.approx([80.0, 0.0], abs=1e-3)
