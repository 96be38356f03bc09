"""The measure of stop lines tells those on a crossing, behind it, and behind room for a car."""

from __future__ import annotations

import msgspec
import numpy as np
import pytest

from foretwin.contracts.world import World
from tests.world_gen.drawn_maps import AVENUE, CROSS, STREET, drawn_map, world_of
from tests.world_gen.measure_stop_lines import Case, cases

ZEBRA = {"highway": "crossing", "crossing": "zebra"}


def _moved(east_m: float, crossing: dict[str, str] | None = None) -> list[Case]:
    """Measure a crossing 40 m west of a junction, with the line from the west moved there and on.

    It lies `east_m` past the crossing's middle.
    """
    osm = drawn_map(
        CROSS | {5: (-40.0, 0.0)},
        [
            (11, [0, 1], STREET),
            (12, [0, 2], AVENUE),
            (13, [3, 5, 0], STREET),
            (14, [4, 0], AVENUE),
        ],
        node_tags={5: crossing or ZEBRA},
    )
    world = world_of(osm)
    return list(cases(_with_line_at(world, -40.0 + east_m)))


def _with_line_at(world: World, x_m: float) -> World:
    (line,) = [ln for ln in world.stop_lines if ln.lane_id.startswith("w13.")]
    x, y = line.ends.T
    moved = msgspec.structs.replace(line, ends=np.column_stack([np.full_like(x, x_m), y]))
    others = tuple(ln for ln in world.stop_lines if ln is not line)
    return msgspec.structs.replace(world, stop_lines=(*others, moved))


@pytest.mark.parametrize(
    ("east_m", "kind"),
    [(-1.9, "on"), (-2.4, "on"), (0.0, "on"), (2.4, "on"), (2.6, "behind"), (6.6, "behind")],
)
def test_a_line_on_a_crossing_or_close_behind_it_is_a_fault(east_m, kind):
    (case,) = _moved(east_m)
    assert (case.kind, case.marked) == (kind, True)
    assert case.past_m == pytest.approx(east_m + 3.0, abs=0.05)
    assert case.junction_control == "uncontrolled"


def test_behind_room_for_a_car_it_is_told_apart():
    (case,) = _moved(6.9)
    assert case.kind == "room"


@pytest.mark.parametrize("east_m", [-2.7, -30.0, 17.0])
def test_a_line_before_a_crossing_or_far_behind_it_is_none(east_m):
    assert _moved(east_m) == []


def test_a_crossing_without_marks_is_told():
    (case,) = _moved(0.0, {"highway": "crossing", "crossing": "unmarked"})
    assert not case.marked
