"""What the car does by itself: turns with and without a map, changes of lane, stops."""

from __future__ import annotations

import functools
import math

import numpy as np
import pytest

from foretwin.contracts.arrays import Array
from foretwin.contracts.world import World
from foretwin.sim_worker.analysis.occurred.ego_manoeuvres import within
from foretwin.sim_worker.analysis.occurred.recognise import recognise
from foretwin.sim_worker.analysis.occurred.roads import Roads
from tests.sim_worker.analysis.occurred.scenes import CAR, START_NS, ego_along, kinds, seen_in
from tests.sim_worker.scenarios.worlds import cross
from tests.world_gen.drawn_maps import AVENUE, STREET, crossing, world_of


@functools.cache
def wide() -> World:
    """The crossing with two lanes each way from west to east."""
    return world_of(crossing(street=STREET | {"lanes": "4"}, avenue=AVENUE))


def bend(sign: float, *, turn_rad: float = math.pi / 2.0, radius_m: float = 8.0) -> Array:
    """East to the origin, round by an angle, and straight on for 50 m."""
    angle = np.linspace(0.0, turn_rad, 30)
    arc = np.stack([radius_m * np.sin(angle), sign * radius_m * (1.0 - np.cos(angle))], axis=1)
    way = np.array([math.cos(turn_rad), sign * math.sin(turn_rad)])
    begin = np.array([[-radius_m - 60.0, -1.6]])
    ends = arc + np.array([-radius_m, -1.6])
    return np.concatenate([begin, ends, ends[-1:] + 50.0 * way])


@pytest.mark.parametrize(
    ("sign", "turn_rad", "kind"),
    [
        (1.0, math.pi / 2.0, "turn_left"),
        (-1.0, math.pi / 2.0, "turn_right"),
        (1.0, math.pi, "u_turn"),
    ],
)
@pytest.mark.parametrize("mapped", [True, False])
def test_turns_are_told_with_a_map_and_without(
    sign: float, turn_rad: float, kind: str, *, mapped: bool
) -> None:
    radius_m = 4.0 if kind == "u_turn" else 8.0
    ego = ego_along(bend(sign, turn_rad=turn_rad, radius_m=radius_m), np.full(180, 7.0))
    worlds = (cross(),) if mapped else ()

    rows = recognise(ego, (), Roads(worlds, cross().frame), vehicle=CAR)

    assert kinds(rows) == [kind]
    assert rows[0].junction_id == (cross().intersection.id if mapped else "")


@pytest.mark.parametrize("side", ["left", "right"])
def test_a_change_of_lane_is_one_where_the_map_has_another_lane(side: str) -> None:
    x = np.arange(-95.0, -5.0, 1.0)
    share = np.clip((x + 75.0) / 40.0, 0.0, 1.0)
    smooth = share * share * (3.0 - 2.0 * share)
    outer_m, inner_m = -4.9, -1.6
    begin, end = (outer_m, inner_m) if side == "left" else (inner_m, outer_m)
    ego = ego_along(np.stack([x, begin + (end - begin) * smooth], axis=1), np.full(85, 10.0))

    assert kinds(seen_in(ego, world=wide())) == [f"lane_change_{side}"]
    assert kinds(seen_in(ego, world=cross())) == []


def test_a_stop_is_the_braking_before_a_standstill() -> None:
    time_s = np.arange(0.0, 14.0, 0.1)
    speed = np.interp(time_s, [0.0, 4.0, 7.0, 10.0, 13.0], [6.0, 6.0, 0.0, 0.0, 6.0])
    ego = ego_along(np.array([[-90.0, -1.6], [100.0, -1.6]]), speed)

    stop, stands = seen_in(ego)

    assert (stop.kind, stands.kind) == ("stop", "standstill")
    assert (stands.begin_ns - START_NS) * 1e-9 == pytest.approx(6.9, abs=0.2)
    assert (stands.end_ns - START_NS) * 1e-9 == pytest.approx(10.1, abs=0.2)


def test_points_lie_within_an_outline_or_beside_it() -> None:
    outline = np.array([[0.0, 0.0], [4.0, 0.0], [4.0, 4.0], [2.0, 1.0], [0.0, 4.0]])
    points = np.array([[2.0, 0.5], [2.0, 3.0], [0.5, 2.0], [5.0, 1.0]])

    assert within(outline, points).tolist() == [True, False, True, False]
