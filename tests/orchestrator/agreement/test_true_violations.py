"""Cars that truly leave the road or brake too hard, from states to verdicts, however well known."""

from __future__ import annotations

import msgspec
import numpy as np
import pytest

from foretwin.contracts.arrays import Array
from foretwin.contracts.futures import PathAhead
from foretwin.contracts.world import ATTRIBUTION, World
from foretwin.geometry.frenet_path import FrenetPath
from foretwin.orchestrator.agreement.windows import OpenWindows
from foretwin.orchestrator.instructions import LatestReports
from foretwin.sim_worker.analysis.agreement.tally import Judged
from tests.orchestrator.agreement.test_windows import VEHICLE, WORLD
from tests.orchestrator.futures_rounds import round_done
from tests.orchestrator.trip import states_along

RATE_HZ, SPEED_MPS = 10.0, 5.0
MAPPED = msgspec.structs.replace(WORLD, attribution=ATTRIBUTION)
"""The same town as a map of a place, whose widths are defaults."""
LANE = FrenetPath(
    max(
        (np.asarray(lane.centerline) for lane in WORLD.lanes if not lane.right_id),
        key=lambda line: float(np.hypot(*np.diff(line, axis=0).T).sum()),
    )
)
"""The longest at a right-hand edge."""
AT_M = 20.0 + np.arange(0.0, 46.0, 0.5)


def way(aside_m: float = 0.0) -> Array:
    """46 m along the lane, ending so far to the right of it."""
    return LANE.point_at(AT_M, -aside_m * np.clip((AT_M - 30.0) / 20.0, 0.0, 1.0))


def simulated() -> Array:
    """States (1, 81, 8) of a car that keeps to the lane and its speed."""
    pose = LANE.pose_at(20.0 + SPEED_MPS * np.arange(81) / RATE_HZ)
    states = np.zeros((1, 81, 8))
    states[0, :, :3] = np.column_stack([pose.xy_m, pose.yaw_rad])
    states[0, :, 3] = SPEED_MPS
    return states


def judged(world: World, line: Array, *, speeds_mps: Array | None = None) -> Judged:
    """The verdicts on 8 s along a line, where speeds (81,) are told, with noise."""
    noise = np.random.default_rng(9).normal(0.0, 0.03, 200)
    handler = OpenWindows(VEHICLE, horizon_s=8.0)
    handler.antenna_known = True
    path = PathAhead(xy_m=way(), speed_limit_mps=np.full(len(AT_M), 14.0))
    for number, plain in enumerate(states_along(world.frame, line, speed_mps=SPEED_MPS)):
        speed = SPEED_MPS if speeds_mps is None else float(np.interp(number, range(81), speeds_mps))
        state = msgspec.structs.replace(
            plain, position_std_m=0.05, speed_mps=speed + float(noise[number]),
            speed_std_mps=0.03, yaw_std_rad=0.005,
        )  # fmt: skip
        handler.take(LatestReports(None, None, ()), state)
        if number == 0:
            done = round_done(simulated(), round_id=1, stamp_ns=state.stamp_ns)
            handler.take_round(done, path, world)
    (one,) = handler.finish()
    return one


@pytest.mark.parametrize(
    ("aside_m", "drawn", "mapped"),
    [
        (0.0, "passed", "passed"),
        (4.0, "failed", "not_observable"),
        (14.0, "failed", "failed"),
    ],
)
def test_who_leaves_the_road_is_caught_as_far_as_the_map_tells(
    aside_m: float, drawn: str, mapped: str
) -> None:
    words = [judged(world, way(aside_m)).verdicts.driven_word for world in (WORLD, MAPPED)]
    assert words == [drawn, mapped]


@pytest.mark.parametrize(
    ("decel_mps2", "word"), [(2.0, "passed"), (6.0, "failed"), (9.0, "failed")]
)
def test_who_brakes_too_hard_is_caught_on_any_map(decel_mps2: float, word: str) -> None:
    time_s = np.arange(81) / RATE_HZ
    speeds = 15.0 - decel_mps2 * np.clip(time_s - 3.0, 0.0, 12.0 / decel_mps2)
    for world in (WORLD, MAPPED):
        found = judged(world, way(), speeds_mps=speeds)
        assert found.verdicts.driven_word == word
        assert found.outcome == ("agree_pass" if word == "passed" else "too_optimistic")
