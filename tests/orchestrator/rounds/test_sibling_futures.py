"""How far two engines are apart in a future that both have played, and when that matters."""

from __future__ import annotations

from pathlib import Path

import msgspec
import numpy as np
import pytest

from foretwin.contracts.siblings import SiblingFuture
from foretwin.contracts.simulation import RED_FROM
from foretwin.orchestrator.rounds.siblings import (
    SIBLING,
    AskedSiblings,
    disagreement_text,
    sibling_futures,
)
from tests.orchestrator.house import straight_futures
from tests.orchestrator.rounds.test_siblings import SiblingHouse


@pytest.fixture
def house(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> SiblingHouse:
    made = SiblingHouse(tmp_path, monkeypatch)
    made.drive(20)
    return made


def answered(house: SiblingHouse, *, criticality: float) -> list[SiblingFuture]:
    """What comes of a nominal and a worst future, of which the second engine hits in the latter."""
    house.round()
    (question,) = house.second.take()
    job = question.message().decoded()
    job = msgspec.structs.replace(job, futures=(job.futures[0], job.futures[0]))
    world = house.conductor.worlds.world(job.world_id)
    result = straight_futures(job, world, SIBLING)
    result.outcome.collided[1] = True
    nobody = np.zeros(2, dtype=bool)
    asked = AskedSiblings(
        job, ("a-0", "a-1"), result.trajectory.states, nobody, np.array([0.0, criticality]), 0.0
    )
    house.tables.close()
    return sibling_futures(asked, result, cpu_s=1.0, took_s=0.1)


@pytest.mark.parametrize(("criticality", "matters"), [(RED_FROM, True), (0.9 * RED_FROM, False)])
def test_of_the_worst_future_only_a_red_one_matters(
    house: SiblingHouse, criticality: float, matters: bool
) -> None:
    nominal, worst = answered(house, criticality=criticality)
    assert (nominal.which, worst.which) == ("nominal", "worst")
    assert (nominal.matters, worst.matters) == (False, matters)
    assert nominal.heading_rad == 0.0
    assert nominal.cpu_seconds == 0.5
    assert disagreement_text(worst) == (
        "engines disagree: the worst future collides on multibody alone"
    )


@pytest.mark.parametrize(
    ("horizon_s", "apart_m", "heading_rad"),
    [
        (5.0, [0.5, 2.0, 8.0], 0.4), (4.0, [0.5, 2.0, 8.0], 0.4), (3.9, [0.5, 2.0, None], 0.2),
        (1.5, [0.5, None, None], 0.1),
    ],
)  # fmt: skip
def test_engines_are_compared_at_instants_that_the_future_has(
    house: SiblingHouse, horizon_s: float, apart_m: list[float | None], heading_rad: float
) -> None:
    """The second engine's car leaves by t² / 2 m and turns by 0.1 rad each second, over π."""
    house.round()
    (question,) = house.second.take()
    job = msgspec.structs.replace(question.message().decoded(), horizon_s=horizon_s)
    job = msgspec.structs.replace(job, futures=job.futures[:1])
    result = straight_futures(job, house.conductor.worlds.world(job.world_id), SIBLING)
    time_s = np.arange(round(horizon_s / job.step_s) + 1) * job.step_s
    ours = result.trajectory.states[:, : len(time_s)].copy()
    ours[:, :, 2] = 3.1
    theirs = ours.copy()
    theirs[:, :, 0] += 0.3 * time_s**2
    theirs[:, :, 1] -= 0.4 * time_s**2
    theirs[:, :, 2] += 0.1 * time_s - 2.0 * np.pi
    moved = msgspec.structs.replace(result.trajectory, time_s=time_s, states=theirs)
    asked = AskedSiblings(job, ("a-0",), ours, np.zeros(1, dtype=bool), np.zeros(1), 0.0)
    (found,) = sibling_futures(
        asked, msgspec.structs.replace(result, trajectory=moved), cpu_s=0.7, took_s=0.2
    )
    house.tables.close()

    told = [found.apart_1_s_m, found.apart_2_s_m, found.apart_4_s_m]
    assert told == [None if one is None else pytest.approx(one, abs=1e-3) for one in apart_m]
    assert found.heading_rad == pytest.approx(heading_rad, abs=1e-5)
    assert found.matters == (apart_m[2] is not None), "more than a metre after 4 s"
    assert (found.round_id, found.stamp_ns) == (job.round_id, job.state.stamp_ns)
    assert (found.which, found.future_id, found.engine) == ("nominal", "a-0", "multibody")
    assert (found.cpu_seconds, found.took_s) == (0.7, 0.2)


@pytest.mark.parametrize(("apart_m", "matters"), [(0.99, False), (1.01, True)])
def test_a_nominal_future_that_is_a_metre_apart_matters_and_a_worst_one_does_not(
    house: SiblingHouse, apart_m: float, matters: bool
) -> None:
    house.round()
    (question,) = house.second.take()
    job = question.message().decoded()
    job = msgspec.structs.replace(job, futures=(job.futures[0], job.futures[0]))
    result = straight_futures(job, house.conductor.worlds.world(job.world_id), SIBLING)
    ours = result.trajectory.states.copy()
    result.trajectory.states[:, :, 1] += apart_m
    nobody = np.zeros(2, dtype=bool)
    asked = AskedSiblings(job, ("a-0", "a-1"), ours, nobody, np.ones(2), 0.0)
    house.tables.close()
    nominal, worst = sibling_futures(asked, result, cpu_s=1.0, took_s=0.1)
    assert (nominal.matters, worst.matters) == (matters, False)
