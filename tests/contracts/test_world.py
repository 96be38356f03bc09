"""What a World's parts say of themselves: who goes, and what a stop line lies across."""

from __future__ import annotations

import msgspec
import numpy as np
import pytest

from foretwin.contracts.world import Conflict, StopLine
from tests.orchestrator.trip import town_world


@pytest.mark.parametrize(("yields", "goes"), [("a", "b"), ("b", "a")])
def test_of_two_whose_paths_meet_one_goes(yields: str, goes: str) -> None:
    conflict = Conflict(
        first_id="a", second_id="b", kind="crossing", point=np.zeros(2), area=np.zeros((0, 2)),
        yields_id=yields, rule="right_hand", source="inferred",
    )  # fmt: skip
    assert conflict.goes_id == goes


def test_a_stop_line_lies_across_its_lane_or_its_connection() -> None:
    line = town_world("n4").stop_lines[0]
    plain = msgspec.structs.replace(line, lane_id="l", connection_id=None)
    assert isinstance(plain, StopLine)
    assert plain.across_id == "l"
    assert msgspec.structs.replace(plain, connection_id="c").across_id == "c"
