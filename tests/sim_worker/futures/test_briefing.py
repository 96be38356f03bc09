"""What a driving stack is shown: who is who, where, when, and what the lights show."""

from __future__ import annotations

import msgspec
import numpy as np
import pytest

from foretwin.contracts.drive import SignalState
from foretwin.contracts.futures import Future, Job, PlannerTiming, SeenRoadUser
from foretwin.contracts.job_identity import future_id, job_bytes
from foretwin.contracts.planner_link import LINK_VERSION
from foretwin.sim_worker.batch.batch_simulation import BatchSimulation
from foretwin.sim_worker.futures.briefing import briefing_of
from foretwin.sim_worker.futures.play import Play
from foretwin.sim_worker.futures.scene import SceneMaker
from foretwin.sim_worker.planner_interface import Briefing, PlannerView
from foretwin.sim_worker.planners.scene_message import Asked, scene_message
from foretwin.sim_worker.vehicle.parameters import load_vehicle
from tests.sim_worker.places import crossroads, job

COVERS = ("foretwin.sim_worker.planners.scene_message",)

ASKED = Asked("r1", "w0", 4, 7, 60.0, reset=True)


@pytest.fixture(scope="module")
def begun() -> tuple[Job, Briefing, PlannerView]:
    """A job with a detected car and a walker of a scenario in one of its futures, at its start."""
    car = SeenRoadUser(
        user_id="17", kind="car", x_m=-20.0, y_m=-1.5, yaw_rad=0.0, speed_mps=4.0, length_m=4.5,
        width_m=1.8,
    )  # fmt: skip
    futures = (
        Future(index=0, name="plain", planner="mine"),
        Future(index=1, name="other", planner="mine"),
    )
    asked = msgspec.structs.replace(
        job(futures),
        road_users=(car,),
        signals=(SignalState(group_id="g1", stamp_ns=0, colour="red"),),
        planner_timing=PlannerTiming(rate_hz=20.0, latency_s=0.1),
        seed=5,
    )
    stage, maker = BatchSimulation(crossroads(), load_vehicle(), nsim=2), SceneMaker(crossroads())
    scene = maker.scene(asked, load_vehicle(), tick_s=0.05)
    view = Play(scene, stage).look(0, stage.states)
    return asked, briefing_of(asked, asked, maker, scene), view


def test_a_scene_tells_who_is_who_and_where(begun: tuple[Job, Briefing, PlannerView]) -> None:
    asked, briefing, view = begun
    scene = scene_message(view._replace(time_s=1.5), ASKED, np.arange(2), briefing)
    assert (scene.link, scene.reset, scene.job, scene.question) == (LINK_VERSION, True, 4, 7)
    assert scene.world_id == "crossroads"
    assert scene.stamp_ns == asked.state.stamp_ns + 1_500_000_000
    assert scene.user_ids == (("seen 17",), ("seen 17",))
    assert scene.user_kinds == (("car",), ("car",))
    assert scene.user_lane_ids == (("from_east",), ("from_east",))
    assert scene.road_users[0, 0, :2] == pytest.approx([-20.0, -1.5], abs=0.1)
    assert set(scene.path_lane_ids) == {"from_east", "east", "to_east"}
    assert len(scene.path_lane_ids) == len(scene.path_xy_m)
    assert scene.signals == {"g1": "red"}


def test_futures_are_called_as_in_results_and_have_seeds_of_their_own(
    begun: tuple[Job, Briefing, PlannerView],
) -> None:
    asked, briefing, _ = begun
    sha256 = job_bytes(asked).sha256
    assert briefing.future_ids == (future_id(sha256, 0), future_id(sha256, 1))
    assert briefing.seeds[0] != briefing.seeds[1]
    assert (briefing.rate_hz, briefing.latency_s) == (20.0, 0.1)


def test_who_is_shown_some_futures_is_shown_theirs_alone(
    begun: tuple[Job, Briefing, PlannerView],
) -> None:
    _, briefing, view = begun
    scene = scene_message(view, ASKED, np.array([1]), briefing)
    assert scene.futures == (1,)
    assert scene.future_ids == briefing.future_ids[1:]
    assert scene.seeds == briefing.seeds[1:]
    assert len(scene.states) == len(scene.road_users) == len(scene.user_ids) == 1


def test_without_a_briefing_it_is_shown_what_moves(
    begun: tuple[Job, Briefing, PlannerView],
) -> None:
    scene = scene_message(begun[2], ASKED, np.arange(2), None)
    assert (scene.world_id, scene.user_ids) == (None, ())
    assert scene.road_users.shape == (2, 1, 7)
