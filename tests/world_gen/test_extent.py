"""Roads are cut where the World ends."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from foretwin.geometry.polyline import cut, points_at
from foretwin.world_gen.extent import Disc, Rectangle, stretches_inside

DETOUR = np.array([[-4.0, 0.0], [0.0, 0.0], [0.0, 20.0], [1.0, 20.0], [1.0, 0.0], [4.0, 0.0]])
THROUGH = np.array([[-50.0, 3.0], [50.0, 3.0]])


def test_a_road_through_a_disc_keeps_the_piece_inside():
    ((begin, stop),) = stretches_inside(THROUGH, Disc(5.0))
    np.testing.assert_allclose(cut(THROUGH, begin, stop), [[-4.0, 3.0], [4.0, 3.0]])


def test_a_road_through_a_rectangle_keeps_the_piece_inside():
    ((begin, stop),) = stretches_inside(THROUGH, Rectangle(-7.0, 0.0, 9.0, 4.0))
    np.testing.assert_allclose(cut(THROUGH, begin, stop), [[-7.0, 3.0], [9.0, 3.0]])


def test_a_road_that_leaves_and_returns_has_two_pieces():
    assert len(stretches_inside(DETOUR, Disc(10.0))) == 2
    assert len(stretches_inside(DETOUR, Rectangle(-10.0, -10.0, 10.0, 10.0))) == 2


def test_a_road_inside_is_one_piece():
    assert stretches_inside(THROUGH, Disc(60.0)) == [(0.0, 100.0)]


@given(
    st.lists(st.tuples(st.floats(-30, 30), st.floats(-30, 30)), min_size=2, max_size=8),
    st.sampled_from([Disc(10.0), Rectangle(-12.0, -6.0, 8.0, 9.0)]),
)
def test_every_kept_piece_lies_inside(points, extent):
    line = np.array(points) + np.arange(len(points))[:, None] * [1e-3, 0.0]
    for begin, stop in stretches_inside(line, extent):
        middle = points_at(line, np.linspace(begin, stop, 9)[1:-1])
        grown = Disc(10.001) if isinstance(extent, Disc) else Rectangle(-12.1, -6.1, 8.1, 9.1)
        assert grown.holds(middle).all()
