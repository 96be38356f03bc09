"""Every kind of road user that a message can name has a size and limits that make sense."""

from __future__ import annotations

import math
from typing import get_args

import pytest

from foretwin.contracts.drive import RoadUserKind
from foretwin.sim_worker.vehicle.road_user_kinds import KINDS


def test_every_kind_has_traits() -> None:
    assert set(KINDS) == set(get_args(RoadUserKind))


@pytest.mark.parametrize("kind", KINDS)
def test_traits_are_those_of_something_on_a_road(kind: RoadUserKind) -> None:
    traits = KINDS[kind]
    assert 0.3 <= traits.width_m <= 2.55  # the widest that roads admit: Directive 96/53/EC
    assert traits.width_m <= traits.length_m
    assert 0.0 < traits.decel_mps2 <= traits.hard_decel_mps2 <= 10.0
    assert 50.0 < traits.mass_kg < 40_000.0
    assert traits.source


def test_who_walks_is_lighter_and_slower_than_who_rides() -> None:
    order = ("pedestrian", "bicycle", "motorcycle", "car", "van", "lorry", "bus", "tram")
    masses = [KINDS[kind].mass_kg for kind in order]
    assert masses == sorted(masses)
    assert KINDS["pedestrian"].speed_mps < KINDS["bicycle"].speed_mps < KINDS["tram"].speed_mps
    assert [kind for kind in KINDS if not KINDS[kind].keeps_lane] == ["pedestrian"]


def test_nobody_wants_a_share_of_a_limit_beyond_what_it_can_drive() -> None:
    assert KINDS["bicycle"].limit_mps(13.9) == KINDS["bicycle"].speed_mps
    assert KINDS["car"].limit_mps(13.9) == 13.9
    assert KINDS["bicycle"].limit_mps(math.inf) == math.inf, "an unknown limit stays unknown"
