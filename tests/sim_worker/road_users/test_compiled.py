"""Who is ahead of whom: kernels against the plain formulas, pair by pair."""

from __future__ import annotations

import math

import numpy as np
import pytest
import shapely
from hypothesis import assume, given
from hypothesis import strategies as st

from foretwin.contracts.arrays import Array
from foretwin.sim_worker.road_users.compiled import (
    FIELDS,
    find_ahead,
    hide_behind,
    interpolate,
    nearest_in_way,
    take_nearest,
)

SIGHT_M, BESIDE_M = 25.0, 0.3
EGO_SIZE_M = (4.6, 1.9)
FUTURES, OTHERS = 5, 7


def pair(driver: Array, other: Array, length_m: float, width_m: float) -> tuple[float, bool, float]:
    """Return the gap, whether the other is in the way, and how it is turned, as one would draw it.

    `driver` is x, y, yaw, bend, width, length, `other` x, y, yaw.
    """
    x, y, yaw, bend, width, length = driver
    along, left = math.cos(yaw), math.sin(yaw)
    dx, dy = other[0] - x, other[1] - y
    ahead, aside = along * dx + left * dy, along * dy - left * dx
    turned = other[2] - yaw
    cos, sin = abs(math.cos(turned)), abs(math.sin(turned))
    gap = ahead - length / 2 - (length_m * cos + width_m * sin) / 2
    reach = (width + length_m * sin + width_m * cos) / 2 + BESIDE_M
    seen = ahead > 0.0 and math.hypot(dx, dy) < SIGHT_M
    return gap, seen and abs(aside - bend / 2 * ahead**2) < reach, turned


@pytest.mark.parametrize("seed", range(8))
def test_the_lead_is_the_nearest_in_the_own_lane(seed: int) -> None:
    random = np.random.default_rng(seed)
    poses = random.uniform((-20, -6, -3), (20, 6, 3), (FUTURES, OTHERS, 3))
    poses[0, 3] = np.nan  # absent
    ego = random.uniform((-20, -6, -3), (20, 6, 3), (FUTURES, 3))
    speed, ego_speed = random.uniform(0, 15, (FUTURES, OTHERS)), random.uniform(0, 15, FUTURES)
    length = random.uniform(1, 8, (FUTURES, OTHERS))
    width = random.uniform(0.5, 2.5, (FUTURES, OTHERS))
    rows, columns = np.nonzero(~np.isnan(poses[..., 0]))
    x, y, yaw = poses[rows, columns].T
    bend = random.uniform(-0.05, 0.05, len(rows))
    own = (width[rows, columns], length[rows, columns])
    mine = np.stack([x, y, yaw, np.cos(yaw), np.sin(yaw), bend / 2, own[0], own[1] / 2])
    who = np.empty(len(rows) * (OTHERS + 1), dtype=np.intp)
    found = np.empty((FIELDS, len(who)))
    count = find_ahead(
        rows, mine, ego, ego_speed, EGO_SIZE_M, poses, speed, length, width,
        (SIGHT_M, BESIDE_M), who, found,
    )  # fmt: skip
    gap, lead = np.full(len(rows), np.inf), np.zeros(len(rows))
    turned = found[2, :count]
    take_nearest(
        who[:count], found[:, :count], np.cos(turned), np.sin(turned), mine, BESIDE_M, gap, lead
    )
    followed = 0
    for k, (row, column) in enumerate(zip(rows, columns, strict=True)):
        driver = np.array([x[k], y[k], yaw[k], bend[k], own[0][k], own[1][k]])
        others = [(ego[row], EGO_SIZE_M, ego_speed[row])]
        others += [
            (poses[row, o], (length[row, o], width[row, o]), speed[row, o])
            for o in range(OTHERS)
            if o != column
        ]
        best = math.inf, 0.0
        for place, size, pace in others:
            room, in_way, turn = pair(driver, place, *size)
            if in_way and room < best[0]:
                best = room, max(pace * math.cos(turn), 0.0)
        followed += math.isfinite(best[0])
        assert (gap[k], lead[k]) == pytest.approx(best)
    assert 0 < followed < len(rows)


def test_nobody_beyond_sight_is_followed_however_wide_the_way_bends() -> None:
    mine = np.array([[0.0, 0.0, 0.0, 1.0, 0.0, 0.025, 2.0, 2.0]]).T
    who, found = np.empty(2, dtype=np.intp), np.empty((FIELDS, 2))
    for y, seen in ((14.4, 1), (15.0, 0)):
        here, nobody = np.array([[20.5, y, 0.0]]), np.full((1, 1, 3), np.nan)
        mine[5] = y / 20.5**2
        one = np.ones((1, 1))
        assert seen == find_ahead(
            np.zeros(1, dtype=np.intp), mine, here, np.zeros(1), EGO_SIZE_M, nobody, one, one, one,
            (SIGHT_M + 0.1, BESIDE_M), who, found,
        )  # fmt: skip


@pytest.mark.parametrize("seed", range(8))
def test_on_the_path_the_next_in_the_way_counts(seed: int) -> None:
    random = np.random.default_rng(seed)
    shape = (40, 4)
    arc, offset = random.uniform(-10, 40, shape), random.uniform(-4, 4, shape)
    arc[0] = np.nan  # seen by nobody
    turned, speed = random.uniform(-3, 3, shape), random.uniform(0, 15, shape)
    length, width = random.uniform(1, 8, shape), random.uniform(0.5, 2.5, shape)
    own_arc, own_offset = random.uniform(-2, 2, 40), random.uniform(-1, 1, 40)
    gap, lead = np.empty((2, 40))
    own_m = 3.7, 4.6, 1.9, BESIDE_M
    nearest_in_way(
        arc, offset, np.cos(turned), np.sin(turned), speed, length, width, own_arc, own_offset,
        own_m, gap, lead,
    )  # fmt: skip
    cos, sin = np.abs(np.cos(turned)), np.abs(np.sin(turned))
    room = arc - own_arc[:, None] - 3.7 - (length * cos + width * sin) / 2
    reach = (length * sin + width * cos + 1.9) / 2 + BESIDE_M
    in_way = (np.abs(offset - own_offset[:, None]) < reach) & (room > -4.6)
    room = np.where(in_way, room, np.inf)
    which = np.arange(40), room.argmin(axis=1)
    assert gap == pytest.approx(room[which])
    there = np.isfinite(room[which])
    assert lead == pytest.approx(np.where(there, (speed * np.cos(turned))[which], 0.0))
    assert 0 < there.sum() < 40


def test_places_between_nodes_and_beyond_their_ends() -> None:
    nodes = np.array([[0.0, 0.0, 0.1], [1.0, 0.5, 0.2], [2.0, 1.5, 0.4]])
    steps = np.diff(nodes, axis=0, append=nodes[-1:])
    found = np.empty((3, 3))
    interpolate(np.array([0, 1, 1]), np.array([-2.0, 0.25, 3.0]), nodes, steps, found)
    assert found == pytest.approx(
        np.array([[-2.0, -1.0, -0.1], [1.25, 0.75, 0.25], [4.0, 3.5, 0.8]])
    )


VAN_M = 6.0, 2.0
ANYWHERE = st.tuples(st.floats(-15.0, 15.0), st.floats(-15.0, 15.0))


def hidden_by_van(eyes: tuple[float, float], walker: tuple[float, float], van: Array) -> bool:
    """Ask it of one future, in which a van (3,) stands before a walker, and of another beside."""
    poses = np.full((2, 2, 3), np.nan)
    poses[1] = van, (*walker, 0.0)
    pairs = np.array([0, 1]), np.array([1, 1]), np.array([0, 0])
    yaw = poses[pairs[0], pairs[2], 2]
    unseen = np.zeros((2, 2), dtype=bool)
    size = np.broadcast_to([VAN_M, (0.5, 0.5)], (2, 2, 2))
    hide_behind(*pairs, poses, np.cos(yaw), np.sin(yaw), size, np.array([eyes, eyes]), unseen)
    assert not unseen[0].any(), "who is not there hides nobody"
    assert not unseen[1, 0]
    return bool(unseen[1, 1])


@given(eyes=ANYWHERE, walker=ANYWHERE, yaw_rad=st.floats(-4.0, 4.0))
def test_a_van_hides_whoever_a_line_of_sight_reaches_only_through_it(
    eyes: tuple[float, float], walker: tuple[float, float], yaw_rad: float
) -> None:
    half, aside = VAN_M[0] / 2.0, VAN_M[1] / 2.0
    box = shapely.affinity.rotate(
        shapely.box(-half, -aside, half, aside), yaw_rad, (0.0, 0.0), use_radians=True
    )
    line = shapely.LineString([eyes, walker])
    # What only just meets a corner may go either way.
    assume(line.intersects(box.buffer(-1e-6)) == line.intersects(box.buffer(1e-6)))
    assert hidden_by_van(eyes, walker, np.array([0.0, 0.0, yaw_rad])) == line.intersects(box)


@pytest.mark.parametrize(
    ("aside_m", "hidden"),
    [(0.99, True), (1.01, False), (-1.01, False), (1.0, False), (-1.0, False)],
)
def test_a_line_that_runs_along_a_side_is_stopped_within_it_alone(
    aside_m: float, hidden: bool
) -> None:
    eyes, walker = (-20.0, aside_m), (20.0, aside_m)
    assert hidden_by_van(eyes, walker, np.zeros(3)) == hidden
