"""Scenarios of the catalogue, played in closed loop, against what is recognised in them.

The car drives by a planner that gives way. Futures in which somebody is hit end there: where who
turns would have gone is then unknown, and they are left out.
"""

from __future__ import annotations

from collections import Counter
from typing import NamedTuple

import numpy as np
import pytest

from foretwin.contracts.arrays import Array
from foretwin.contracts.frames import wrap_angle
from foretwin.contracts.futures import Future
from foretwin.sim_worker.analysis.occurred.rows import OccurredScenario
from foretwin.sim_worker.analysis.occurred.scene import Detected, DrivenMotion
from foretwin.sim_worker.scenarios.drawing import draw_cases
from foretwin.sim_worker.scenarios.reading import catalogue
from foretwin.sim_worker.scenarios.ways import Way
from foretwin.simulation import Futures, run_futures, state_on, ways_through
from tests.sim_worker.analysis.occurred.scenes import START_NS, kinds, seen_in
from tests.sim_worker.scenarios.worlds import cross

NOISE_M, CASES = 0.3, 4


class Staged34502(NamedTuple):
    """A scenario, how the car goes on in it, and what its definition says that takes place."""

    scenario: str
    turn: str
    kind: str


STAGED = (
    Staged34502("scp", "straight", "crossing_from_left"),
    Staged34502("cccscp", "straight", "crossing_from_right"),
    Staged34502("ltap_od", "straight", "oncoming_turns_across"),
    Staged34502("ccftap", "left", "ego_turns_across_oncoming"),
    Staged34502("ltip", "left", "ego_turns_into_path"),
    Staged34502("cpta", "left", "pedestrian_crossing"),
    Staged34502("cbta", "right", "cyclist_crossing"),
    Staged34502("occluded_pedestrian", "straight", "pedestrian_crossing"),
    Staged34502("lead_stopping", "straight", "lead_decelerates"),
)


def turn_of(way: Way) -> str:
    ends = way.path.pose_at(np.array([way.entry_m - 10.0, way.exit_m + 10.0])).yaw_rad
    change = float(wrap_angle(ends[1] - ends[0]))
    return "straight" if abs(change) < 0.6 else "left" if change > 0.0 else "right"


def played(one: Staged34502) -> Futures:
    """Cases of a scenario on the way of the drawn crossing that it is for."""
    world = cross()
    way = next(way for way in ways_through(world) if turn_of(way) == one.turn)
    cases = draw_cases(catalogue()[one.scenario])[:CASES]
    futures = tuple(
        Future(
            index=index,
            name=one.scenario,
            planner="gap_acceptance",
            scenario_id=one.scenario,
            values=dict(case),
        )
        for index, case in enumerate(cases)
    )
    speed = dict(cases[0]).get("ego.speed_mps", 8.0)
    state = state_on(world, way, before_m=min(4.0 * speed, 60.0), speed_mps=speed)
    return run_futures(
        world, way, state, futures=futures, scenarios=(one.scenario,), horizon_s=12.0
    )


def recognised(futures: Futures, row: int) -> tuple[OccurredScenario, ...]:
    """What is recognised of one future's motion and noisy places of its road users."""
    states: Array = futures.states[row].astype(np.float64)
    stamps = START_NS + np.arange(len(states), dtype=np.int64) * 100_000_000
    yaw, random = np.unwrap(states[:, 2]), np.random.default_rng(row)
    ego = DrivenMotion(stamps, states[:, :2], yaw, states[:, 3], states[:, 7], states[:, 5])
    users = futures.result.road_users
    others = [
        Detected(
            f"u{user}",
            users.kind_names[int(users.kinds[row, user])],
            None,
            stamps,
            users.poses[row, :, user, :2] + random.normal(0.0, NOISE_M, (len(stamps), 2)),
            users.poses[row, :, user, 2].astype(np.float64),
        )
        for user in range(users.poses.shape[2])
        if np.isfinite(users.poses[row, :, user]).any()
    ]
    return seen_in(ego, *others)


@pytest.mark.judge
@pytest.mark.parametrize("one", STAGED, ids=lambda one: one.scenario)
def test_what_the_catalogue_stages_is_recognised(one: Staged34502) -> None:
    futures, told = played(one), Counter[str]()
    for row, of_future in enumerate(futures.rows):
        if of_future["collided"] or of_future["left_out"]:
            told["hit"] += 1
            continue
        found = recognised(futures, row)
        # Who is followed first brakes then: of one actor several kinds may be true.
        right = [kind for kind in kinds(found, "u0") if kind != "following"] == [one.kind]
        told["right" if right else "wrong"] += 1
        turn = "through_straight" if one.turn == "straight" else f"turn_{one.turn}"
        assert turn in kinds(found) or "stop" in kinds(found)

    assert told["wrong"] == 0
    assert told["right"] > 0
