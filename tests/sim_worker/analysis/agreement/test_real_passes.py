"""Real cars on a real crossing: by a map that only counts lanes nobody left the road for sure."""

from __future__ import annotations

from collections import Counter
from pathlib import Path

import numpy as np
import pytest

from foretwin.contracts.arrays import Array
from foretwin.contracts.frames import target_from_source_m
from foretwin.geometry.frenet_path import FrenetPath
from foretwin.sim_worker.analysis.agreement.criteria import CRITERIA, CriteriaEvaluator
from foretwin.sim_worker.analysis.agreement.doubt import WorldDoubt
from foretwin.sim_worker.analysis.agreement.judgement import word
from foretwin.sim_worker.analysis.agreement.window import Users, Window
from foretwin.sim_worker.metrics.route_rules import RouteRules
from tests.sim_worker.metrics.motions import VEHICLE, states_of_centre, times
from tests.world_gen.truth.karlsruhe import karlsruhe_map
from tests.world_gen.truth.reduced_map import reduced
from tests.world_gen.truth.road_edges import world_of

TIME_S = times(8.0)
LEAST_M = 10.0


def states_along(xy_m: Array) -> Array:
    """States (81, 8) of a car whose middle goes along a track."""
    path = FrenetPath(xy_m)
    pose = path.pose_at(np.linspace(0.0, path.length_m, len(TIME_S)))
    return states_of_centre(np.column_stack([pose.xy_m, pose.yaw_rad]), TIME_S)


@pytest.mark.real_data
def test_nobody_is_accused_by_a_map_that_only_counts_lanes(data_dir: Path, tmp_path: Path) -> None:
    truth = karlsruhe_map(data_dir / "traffic-karlsruhe-k729")
    file = tmp_path / "karlsruhe.osm"
    file.write_text(reduced(truth), encoding="utf-8")
    world = world_of(file)
    doubt, at = WorldDoubt(world), CRITERIA.index("drivable_area")
    nobody = Users(np.zeros((81, 0, 3)), np.zeros((81, 0)), np.zeros((0, 2)))
    told: Counter[str] = Counter()
    for track in truth.tracks:
        xy_m = np.asarray(target_from_source_m(world.frame, truth.frame, track.xy_m))
        if np.hypot(*(xy_m[-1] - xy_m[0])) < LEAST_M:
            continue
        driven = states_along(xy_m)
        window = Window(
            1, 0, "", world.id, TIME_S, driven, nobody, driven, nobody, xy_m, {}, False,
            0.1, np.full((81, 2), 0.1), 0.1, True, False,
        )  # fmt: skip
        judge = CriteriaEvaluator(window, RouteRules(world, FrenetPath(xy_m)), doubt, VEHICLE)
        found = judge.judge(driven[None], nobody)
        told[word(bool(found.passes[0, at]), bool(found.fails[0, at]))] += 1
    assert told.total() > 60
    assert told["failed"] == 0
    assert told["not_observable"] > 20  # by the edges as drawn these had left the road
