"""The path ahead on the real drive lies on the lanes of the Worlds that it is driven through."""

from __future__ import annotations

from pathlib import Path

import msgspec
import numpy as np
import pytest

from foretwin.geometry.steering import DRIVEN_CURVATURE_PM
from foretwin.orchestrator.routing.rounding import curvature_pm
from tests.orchestrator.in_process_drive import LockStep, Round
from tests.orchestrator.routing.path_against_lanes import DRIVES, FAR_M, config_of, shares

pytestmark = [pytest.mark.real_data, pytest.mark.judge]


@pytest.fixture(scope="module")
def rounds(data_dir: Path) -> list[Round]:
    (_, map_file, log_file), *_ = DRIVES
    config = msgspec.structs.replace(config_of(data_dir, map_file, log_file, None), rate_hz=1.0)
    return LockStep(config, futures=False).run().rounds


def test_away_from_tight_turns_the_path_lies_on_lanes(rounds: list[Round]) -> None:
    found = shares(rounds)

    assert len(rounds) > 250
    assert len(found.along) > 0.85 * found.points
    assert (found.elsewhere > FAR_M).mean() < 0.005
    # Bends are driven as one, up to a metre from the corners that the map gives them.
    assert np.percentile(found.elsewhere, 95) < 0.25
    assert np.percentile(found.elsewhere, 99) < 0.5
    assert (found.turning > FAR_M).mean() < 0.08


def test_rounds_on_streets_closed_since_are_counted(rounds: list[Round]) -> None:
    off = [one for one in rounds if one.intent.off_lanes_m > 0.0]

    assert 0.2 * len(rounds) < len(off) < 0.5 * len(rounds)


def test_every_path_can_be_steered(rounds: list[Round]) -> None:
    worst = [np.abs(curvature_pm(one.intent.path.xy_m)).max() for one in rounds]

    assert max(worst) < DRIVEN_CURVATURE_PM
