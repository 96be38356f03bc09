"""Numbers of junctions that lie side by side stay readable on the map of a long drive."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from foretwin.orchestrator.report.route_picture import apart

places = st.lists(st.tuples(st.floats(0.0, 500.0), st.floats(0.0, 500.0)), max_size=12)


@given(places)
def test_no_two_marks_cover_each_other(found: list[tuple[float, float]]) -> None:
    shown = apart(np.array(found, dtype=float).reshape(-1, 2), 10.0)

    between = shown[:, None] - shown[None]
    far_m = np.hypot(between[..., 0], between[..., 1]) + 1e6 * np.eye(len(shown))
    assert far_m.min(initial=1e6) > 9.5


def test_marks_that_have_room_stay_where_they_are_and_a_pair_parts_evenly() -> None:
    lone = np.array([[0.0, 0.0], [30.0, 0.0]])
    assert (apart(lone, 10.0) == lone).all()
    assert np.allclose(apart(np.array([[0.0, 0.0], [4.0, 0.0]]), 10.0), [[-3.0, 0.0], [7.0, 0.0]])
