"""How much of a body is seen past others, against lines of sight drawn by shapely."""

from __future__ import annotations

import math

import numpy as np
import pytest
from shapely import LineString, Point, Polygon

from foretwin.geometry.rectangles import Rectangles, corners, overlapping
from foretwin.telemetry.mixed.occlusion import Viewpoint, seen_shares

CASES, RAYS = 100, 300
EYE = Viewpoint(2.0, -1.0, 0.3, math.tau, 80.0)


def rectangles(*rows: tuple[float, float, float, float, float]) -> Rectangles:
    table = np.array(rows, dtype=float)
    return Rectangles(table[:, :2], table[:, 2], table[:, 3], table[:, 4])


def everyone(count: int) -> np.ndarray:
    return np.ones((count, count), dtype=bool)


def seen_by_rays(view: Viewpoint, bodies: Rectangles, index: int) -> float:
    """Return the share of rays through a body that reach it first, and in the field of view."""
    eye = np.array([view.x_m, view.y_m])
    shapes = [Polygon(ring) for ring in corners(bodies)]
    if shapes[index].distance(Point(eye)) > view.range_m:
        return 0.0
    middle = math.atan2(*(bodies.centre_m[index] - eye)[::-1])
    away = corners(bodies)[index] - eye
    turned = [math.remainder(math.atan2(y, x) - middle, math.tau) for x, y in away]
    angles = np.linspace(min(turned), max(turned), RAYS + 2)[1:-1] + middle
    free = 0
    for angle in angles.tolist():
        if abs(math.remainder(angle - view.yaw_rad, math.tau)) > 0.5 * view.field_of_view_rad:
            continue
        ray = LineString([eye, eye + 500.0 * np.array([math.cos(angle), math.sin(angle)])])
        mine = ray.intersection(shapes[index])
        reach = Point(eye).distance(mine)
        others = (s for k, s in enumerate(shapes) if k != index)
        free += not any(
            s.intersects(ray) and Point(eye).distance(s.intersection(ray)) < reach for s in others
        )
    return free / RAYS


def drawn(seed: int) -> tuple[Viewpoint, Rectangles]:
    """Return a sensor and three to eight bodies around it, none within another."""
    rng = np.random.default_rng(seed)
    view = Viewpoint(
        *rng.uniform(-5.0, 5.0, 2).tolist(),
        float(rng.uniform(-math.pi, math.pi)),
        math.tau if seed % 2 else float(rng.uniform(1.0, 6.0)),
        float(rng.uniform(25.0, 60.0)),
    )
    rows: list[tuple[float, ...]] = [(view.x_m, view.y_m, 0.0, 1.0, 1.0)]
    while len(rows) < rng.integers(4, 10):
        x, y = rng.uniform(-35.0, 35.0, 2).tolist()
        size = (0.6, 0.6) if rng.random() < 0.4 else (rng.uniform(3.5, 12.0), rng.uniform(1.5, 2.6))
        row = (x, y, float(rng.uniform(-math.pi, math.pi)), *map(float, size))
        if not overlapping(rectangles(row), rectangles(*rows)).any():  # type: ignore[arg-type]
            rows.append(row)
    return view, rectangles(*rows[1:])  # type: ignore[arg-type]


@pytest.mark.parametrize("seed", range(CASES))
def test_what_is_seen_is_what_lines_of_sight_reach(seed: int) -> None:
    view, bodies = drawn(seed)
    shares = seen_shares(view, bodies, everyone(len(bodies.yaw_rad)))
    index = seed % len(shares)
    assert shares[index] == pytest.approx(seen_by_rays(view, bodies, index), abs=2.0 / RAYS)


def test_drawn_cases_hold_hidden_half_hidden_and_free_bodies() -> None:
    found = np.concatenate(
        [seen_shares(v, b, everyone(len(b.yaw_rad))) for v, b in map(drawn, range(CASES))]
    )
    assert (found == 0.0).sum() > 20
    assert ((found > 0.05) & (found < 0.95)).sum() > 20
    assert (found == 1.0).sum() > 100


def test_a_walker_behind_a_van_is_not_seen_and_one_beside_it_is() -> None:
    van = (12.0, -1.0, math.pi / 2, 5.0, 2.0)
    behind, beside = (16.0, -1.0, 0.0, 0.5, 0.6), (16.0, 6.0, 0.0, 0.5, 0.6)
    shares = seen_shares(EYE, rectangles(van, behind, beside), everyone(3))
    assert shares.tolist() == [1.0, 0.0, 1.0]


def test_only_who_may_hide_another_does() -> None:
    van, behind = (12.0, -1.0, math.pi / 2, 5.0, 2.0), (16.0, -1.0, 0.0, 0.5, 0.6)
    nobody = np.zeros((2, 2), dtype=bool)
    assert seen_shares(EYE, rectangles(van, behind), nobody).tolist() == [1.0, 1.0]


def test_what_is_beyond_the_range_is_not_seen() -> None:
    # Its near end counts: 80 m from the eye.
    near, far = (84.4, -1.0, 0.0, 5.0, 2.0), (84.6, -1.0, 0.0, 5.0, 2.0)
    shares = seen_shares(EYE, rectangles(near, far), np.zeros((2, 2), dtype=bool))
    assert shares.tolist() == [1.0, 0.0]


def test_a_body_across_the_edge_of_the_field_of_view_is_seen_in_part() -> None:
    view = Viewpoint(0.0, 0.0, math.pi, math.pi, 80.0)
    shares = seen_shares(view, rectangles((0.0, 10.0, 0.0, 4.0, 1.0)), everyone(1))
    assert shares[0] == pytest.approx(0.5)
    assert seen_shares(view, rectangles((9.0, 0.0, 0.0, 4.0, 1.0)), everyone(1))[0] == 0.0


def test_a_body_around_the_sensor_is_seen_and_hides_nothing() -> None:
    own, ahead = (2.0, -1.0, 0.3, 4.5, 1.8), (12.0, -1.0, 0.0, 4.5, 1.8)
    assert seen_shares(EYE, rectangles(own, ahead), everyone(2)).tolist() == [1.0, 1.0]
