"""No road user of a swept case does what no vehicle can, on maps of the data folder."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from tests.sim_worker.measure_road_users import MAPS, TICK_S, accelerations, measure, table


def test_accelerations_are_those_of_a_circle_and_of_brakes() -> None:
    """10 m/s round 20 m are 5 m/s² across; 3 m/s² of braking are along."""
    time = np.arange(0.0, 3.0, TICK_S)
    angle = 0.5 * time
    circle = np.stack([20.0 * np.sin(angle), -20.0 * np.cos(angle), angle], axis=-1)
    braked = np.stack([10.0 * time - 1.5 * time**2, 0.0 * time, 0.0 * time], axis=-1)
    speed = np.stack([np.full_like(time, 10.0), 10.0 - 3.0 * time], axis=-1)
    along, across, jolt = accelerations(np.stack([circle, braked], axis=1), speed, TICK_S)
    assert along == pytest.approx([0.0, 3.0], abs=1e-9)
    assert across == pytest.approx([5.0, 0.0], abs=1e-9)
    assert jolt == pytest.approx([5.0, 3.0], rel=0.01)


@pytest.mark.real_data
def test_nobody_is_thrown_about_on_a_few_real_junctions(data_dir: Path) -> None:
    played = measure(data_dir, cases=60, seed=3, maps=MAPS[2:3])
    assert len(played.moved) > 40
    assert [one for one in played.moved if one.beyond] == [], table(played)


@pytest.mark.real_data
@pytest.mark.judge
@pytest.mark.timeout(1800)
def test_nobody_is_thrown_about_in_2000_swept_cases(
    data_dir: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    played = measure(data_dir, cases=2000, seed=0)
    with capsys.disabled():
        print(f"\n{table(played)}")
    assert played.cases >= 2000
    assert [one for one in played.moved if one.beyond] == []
