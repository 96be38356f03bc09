"""Who is on the road, as arrays: what of a player depends on its kind."""

from __future__ import annotations

import numpy as np
import pytest

from foretwin.contracts.drive import RoadUserKind
from foretwin.geometry.frenet_path import FrenetPath
from foretwin.sim_worker.driver_model import OTHERS_LIMIT_SHARE
from foretwin.sim_worker.road_users.cast import Player, casting
from foretwin.sim_worker.vehicle.road_user_kinds import KINDS

STREET = FrenetPath(np.array([[0.0, 0.0], [300.0, 0.0]]), np.full(2, 13.9))


@pytest.mark.parametrize("kind", ["bicycle", "car", "tram"])
def test_nobody_wants_a_share_of_a_limit_that_it_cannot_reach(kind: RoadUserKind) -> None:
    """Two hundred of a kind, seen at 3 m/s in a street with a limit of 50 km/h."""
    seen = Player("seen", kind, STREET, 10.0, 3.0, conduct="law_abiding")
    wanted = casting([[seen]] * 200, ego_path=STREET).crowd.desired_mps

    median, spread = OTHERS_LIMIT_SHARE
    most = min(13.9, KINDS[kind].speed_mps)
    assert np.median(wanted) == pytest.approx(median * most, rel=0.1)
    assert wanted.max() <= median * most * np.exp(2.0 * spread) + 1e-9


def test_without_a_limit_everybody_keeps_the_speed_that_it_has() -> None:
    anywhere = FrenetPath(np.array([[0.0, 0.0], [300.0, 0.0]]))
    seen = Player("seen", "bicycle", anywhere, 10.0, 3.0, conduct="law_abiding")

    assert casting([[seen]], ego_path=anywhere).crowd.desired_mps.tolist() == [[3.0]]
