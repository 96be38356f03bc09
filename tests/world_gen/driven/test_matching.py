"""Along which lane a pass went: by place, by heading, by what follows what."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

from foretwin.contracts.arrays import Array
from foretwin.world_gen.driven.matching import UNKNOWN, LaneLine, Lines
from foretwin.world_gen.driven.passes import Pass, pass_along


def straight(y_m: float, x0_m: float = 0.0, x1_m: float = 200.0) -> Array:
    return np.array([[x0_m, y_m], [x1_m, y_m]])


def pass_of(line: Array) -> Pass:
    found = pass_along(np.linspace(line[0], line[-1], 150) if len(line) == 2 else line)
    assert found is not None
    return found


TWO_LANES = {
    "left": LaneLine(straight(3.0), (), ("right",), False),
    "right": LaneLine(straight(0.0), (), ("left",), False),
    "against": LaneLine(straight(6.0)[::-1], (), (), False),
}


@pytest.mark.parametrize(("y_m", "lane"), [(0.4, "right"), (2.4, "left"), (-1.0, "right")])
def test_a_long_pass_tells_its_lane(y_m: float, lane: str) -> None:
    lines = Lines(TWO_LANES)

    match = lines.match(pass_of(straight(y_m)))

    assert {lines.ids[i] for i in match.line.tolist()} == {lane}
    assert match.clear[10:-10].all()
    assert np.allclose(match.left_m, y_m - TWO_LANES[lane].xy_m[0, 1])


def test_between_two_lanes_nothing_is_clear() -> None:
    assert not Lines(TWO_LANES).match(pass_of(straight(1.45))).clear.any()


def test_who_drives_back_is_on_the_lane_against() -> None:
    lines = Lines(TWO_LANES)

    match = lines.match(pass_of(straight(5.5)[::-1]))

    assert {lines.ids[i] for i in match.line.tolist()} == {"against"}


def test_far_from_all_lanes_a_pass_is_nowhere() -> None:
    match = Lines(TWO_LANES).match(pass_of(straight(-4.9)))

    assert set(match.line.tolist()) == {UNKNOWN}
    assert not match.clear.any()


def test_where_a_pass_turns_later_tells_its_lane_before() -> None:
    angle = np.linspace(0.0, np.pi / 2.0, 20)
    arc = np.stack([100.0 + 10.0 * np.sin(angle), 10.0 * np.cos(angle) - 10.0], axis=1)
    lines = Lines(
        {
            "left": LaneLine(straight(3.0, 0.0, 100.0), (), ("right",), False),
            "right": LaneLine(straight(0.0, 0.0, 100.0), ("turn",), ("left",), False),
            "turn": LaneLine(arc, ("away",), (), True),
            "away": LaneLine(np.array([[110.0, -10.0], [110.0, -80.0]]), (), (), False),
        }
    )
    unclear = np.concatenate([straight(1.45, 0.0, 90.0), arc + 0.2, [[110.0, -60.0]]])
    dense = np.concatenate([np.linspace(a, b, 40) for a, b in pairwise(unclear)])

    match = lines.match(pass_of(dense))

    assert lines.ids[match.line[10]] == "right"
    assert lines.ids[match.line[-5]] == "away"
    assert match.clear[-5]
