"""Ground as SVG: metres become tenths, north is up, and what lies outside is cut off."""

from __future__ import annotations

import re

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from foretwin.orchestrator.report.drawing import Canvas

metres = st.floats(-500.0, 500.0, allow_nan=False)


def test_north_is_up_and_a_metre_is_ten_units() -> None:
    canvas = Canvas(0.0, 0.0, 20.0, 10.0)
    canvas.line(np.array([[0.0, 0.0], [20.0, 10.0]]), 'stroke="red"', title="a < b")

    drawn = canvas.svg("words & more", "#fff")

    assert 'viewBox="0 0 200 100"' in drawn
    assert 'd="M0 100l200-100"' in drawn
    assert "<title>a &lt; b</title>" in drawn
    assert 'aria-label="words &amp; more"' in drawn


def test_what_has_links_is_no_image_to_who_hears_the_page() -> None:
    canvas = Canvas(0.0, 0.0, 10.0, 10.0)
    canvas.words(np.array([5.0, 5.0]), "1", 2.0, 'fill="red"')
    assert '<svg viewBox="0 0 100 100" role="img"' in canvas.svg("", "#fff")

    canvas.words(np.array([5.0, 5.0]), "2", 2.0, 'fill="red"', to="junction-2")

    assert '<svg viewBox="0 0 100 100" role="group"' in canvas.svg("", "#fff")


def test_areas_have_holes_and_are_cut_at_the_edge() -> None:
    canvas = Canvas(0.0, 0.0, 10.0, 10.0)
    square = np.array([[-5.0, -5.0], [20.0, -5.0], [20.0, 20.0], [-5.0, 20.0]])
    hole = np.array([[2.0, 2.0], [4.0, 2.0], [4.0, 4.0], [2.0, 4.0]])
    canvas.area((square, hole), 'fill="red"')
    canvas.area((square + 100.0,), 'fill="blue"')

    drawn = canvas.svg("", "#fff")

    assert drawn.count("Z") == 2
    assert "blue" not in drawn


@given(st.lists(st.tuples(metres, metres), min_size=2, max_size=20))
def test_no_line_leaves_the_picture(points: list[tuple[float, float]]) -> None:
    canvas = Canvas(-30.0, -20.0, 30.0, 20.0)
    canvas.line(np.array(points), "")

    for d in re.findall(r' d="([^"]*)"', canvas.svg("", "#fff")):
        for start in d.split("M")[1:]:
            first, _, rest = start.partition("l")
            numbers = [int(n) for n in re.findall(r"-?\d+", rest)]
            steps = np.array([[int(n) for n in first.split()], *np.reshape(numbers, (-1, 2))])
            x, y = np.cumsum(steps, axis=0).T
            assert (x >= 0).all()
            assert (x <= 600).all()
            assert (y >= 0).all()
            assert (y <= 400).all()
