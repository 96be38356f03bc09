"""What is recognised of drawn drives over a crossing: each kind of encounter, and near misses."""

from __future__ import annotations

import numpy as np
import pytest

from tests.sim_worker.analysis.occurred.scenes import (
    START_NS,
    ego_along,
    ego_eastwards,
    kinds,
    moving,
    other,
    seen_in,
)

COVERS = (
    "foretwin.sim_worker.analysis.occurred.across_way",
    "foretwin.sim_worker.analysis.occurred.along_way",
    "foretwin.sim_worker.analysis.occurred.driven_way",
    "foretwin.sim_worker.analysis.occurred.measures",
    "foretwin.sim_worker.analysis.occurred.roads",
    "foretwin.sim_worker.analysis.occurred.rows",
)


def test_a_car_from_the_right_crosses_behind_whom_one_passes() -> None:
    rows = seen_in(ego_eastwards(), moving("b", (1.6, -1.6), (0.0, 8.0), 8.8))

    assert kinds(rows) == ["through_straight"]
    (row,) = (row for row in rows if row.other_id == "b")
    assert (row.kind, row.side) == ("crossing_from_right", "right")
    # It leaves the car's strip (0.9 + 2.25 m behind its middle) 0.4 s after the middle of it, the
    # car comes to its strip as long before the point: of 1.4 s about 0.7 s are left.
    assert row.pet_s == pytest.approx(0.66, abs=0.15)
    assert row.beyond
    assert row.is_conflict
    assert "MotionCross" in row.tags
    assert "VehicleCar" in row.tags


def test_who_crosses_long_before_meets_nobody() -> None:
    rows = seen_in(ego_eastwards(), moving("b", (1.6, -1.6), (0.0, 8.0), 4.0))

    assert kinds(rows, "b") == []


@pytest.mark.parametrize(("from_y", "side"), [(6.0, "left"), (-6.0, "right")])
def test_somebody_on_foot_crosses(from_y: float, side: str) -> None:
    walks = (0.0, -1.4 if from_y > 0.0 else 1.4)
    rows = seen_in(ego_eastwards(), moving("p", (40.0, -1.6), walks, 14.0, kind="pedestrian"))

    (row,) = (row for row in rows if row.other_id == "p")
    assert (row.kind, row.side) == ("pedestrian_crossing", side)


def test_an_oncoming_car_passes_and_one_on_the_pavement_walks() -> None:
    oncoming = moving("o", (0.0, 1.8), (-9.0, 0.0), 10.0)
    walker = moving("p", (30.0, -6.0), (1.4, 0.0), 10.0, kind="pedestrian")

    rows = seen_in(ego_eastwards(), oncoming, walker)

    assert kinds(rows, "o") == kinds(rows, "p") == []


def test_the_one_ahead_is_followed_and_brakes() -> None:
    time_s = np.arange(0.0, 18.0, 0.1)
    speed = np.clip(8.0 - 2.0 * np.maximum(time_s - 8.0, 0.0), 3.0, 8.0)
    x = -80.0 + 18.0 + np.concatenate([[0.0], np.cumsum(speed[:-1] * 0.1)])
    ego_speed = np.clip(8.0 - 2.0 * np.maximum(time_s - 9.0, 0.0), 3.0, 8.0)
    ego = ego_along(np.array([[-81.3, -1.6], [400.0, -1.6]]), ego_speed)

    rows = seen_in(ego, other("a", np.stack([x, np.full(len(x), -1.6)], axis=1)))

    assert set(kinds(rows, "a")) == {"following", "lead_decelerates"}
    brakes = next(row for row in rows if row.kind == "lead_decelerates")
    assert (brakes.begin_ns - START_NS) / 1e9 == pytest.approx(8.0, abs=0.7)
    assert brakes.time_headway_s is not None
    assert brakes.time_headway_s < 2.0


@pytest.mark.parametrize("inwards", [True, False])
def test_a_car_comes_from_beside_or_goes_there(inwards: bool) -> None:
    time_s = np.arange(0.0, 9.0, 0.1)
    share = np.clip((time_s - 3.0) / 3.0, 0.0, 1.0)
    smooth = share * share * (3.0 - 2.0 * share)
    y = -1.6 + 3.4 * ((1.0 - smooth) if inwards else smooth)
    x = -80.0 + 14.0 + 8.5 * time_s

    rows = seen_in(ego_eastwards(9.0), other("c", np.stack([x, y], axis=1)))

    assert ("cut_in" if inwards else "cut_out") in kinds(rows, "c")
    assert ("cut_out" if inwards else "cut_in") not in kinds(rows, "c")


def test_a_drive_in_which_the_car_stands_says_so_and_no_more() -> None:
    ego = ego_along(np.array([[-40.0, -1.6], [400.0, -1.6]]), np.zeros(100))

    assert seen_in(ego) == ()
