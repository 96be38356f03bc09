"""What the display draws of a World lies where the World says, in the drive's frame."""

from __future__ import annotations

import msgspec
import numpy as np
import pytest

from foretwin.contracts.frames import target_from_source_m
from foretwin.viewer.copilot.junction_plan import REACH_M, junction_plan
from tests.viewer.drawn_junction import WORLD_FRAME, WORLD_ID, junction
from tests.viewer.scene import DRIVE_FRAME


def test_lines_lie_where_the_world_has_them_to_decimetres() -> None:
    world = junction()
    plan = junction_plan(world, DRIVE_FRAME)
    stop = target_from_source_m(DRIVE_FRAME, WORLD_FRAME, world.stop_lines[0].ends)
    assert plan.world_id == WORLD_ID
    assert np.array(plan.stop_lines[0]) == pytest.approx(stop, abs=0.051)
    centre = target_from_source_m(DRIVE_FRAME, WORLD_FRAME, np.zeros((1, 2)))[0]
    assert plan.centre == pytest.approx(centre, abs=0.051)
    assert len(plan.edges) == 2 * len(world.lanes)
    width_m = np.hypot(*(np.array(plan.edges[0][0]) - plan.edges[1][0]))
    assert width_m == pytest.approx(world.lanes[0].width_m.value, abs=0.15)
    assert [len(one) for one in plan.crossings] == [3] * len(world.crossings)
    assert {one.group for one in plan.signals} == {one.group_id for one in world.signals}
    assert plan.attribution == world.attribution


def test_it_is_small_enough_for_a_moment_on_a_tablet_and_leaves_out_what_is_far() -> None:
    world = junction()
    assert len(msgspec.json.encode(junction_plan(world, DRIVE_FRAME))) < 60_000
    far = tuple(
        msgspec.structs.replace(one, outline=one.outline + np.array([0.0, 2.0 * REACH_M]))
        for one in world.buildings
    )
    bare = msgspec.structs.replace(world, buildings=far, stop_lines=(), signals=())
    plan = junction_plan(bare, DRIVE_FRAME)
    assert plan.buildings == plan.stop_lines == plan.signals == []
