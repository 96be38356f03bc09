"""How the roads of an OpenDRIVE file join where they meet."""

from __future__ import annotations

from pathlib import Path

import msgspec
import pytest

from tests.world_gen.drawn_maps import AVENUE, STREET, crossing, world_of
from tests.world_gen.export import drawn_world
from tests.world_gen.export.test_opendrive import check_closed, written


def test_who_turns_obeys_the_slower_of_both_lanes(tmp_path: Path) -> None:
    world = world_of(
        crossing(street=STREET | {"maxspeed": "70"}, avenue=AVENUE | {"maxspeed": "30"})
    )
    limits = {lane.id: lane.speed_limit_mps.value for lane in world.lanes}
    roads = {road.source: road.element for road in written(world, tmp_path).roads.values()}
    said = {
        (limits[c.from_lane_id], limits[c.to_lane_id]): roads[c.id].find(".//lane/speed").get("max")
        for c in world.connections
    }
    slow, fast = 30.0 / 3.6, 70.0 / 3.6
    wanted = {(fast, fast): fast, (fast, slow): slow, (slow, fast): slow, (slow, slow): slow}
    assert {pair: float(limit) for pair, limit in said.items()} == pytest.approx(wanted, abs=0.001)


def test_lanes_go_on_where_reference_lines_lie_apart(tmp_path: Path) -> None:
    before = drawn_world.road("before", [[0, 0], [50, 0]], ahead=[3.0, 3.0])
    after = drawn_world.road("after", [[50, 1.5], [90, 1.5]], ahead=[3.0, 3.0])
    goes_on = drawn_world.leading_to(before[1], {"before.f0": "after.f0", "before.f1": "after.f1"})
    aside = [
        msgspec.structs.replace(
            lane,
            centerline=lane.centerline - [0.0, 1.5],
            left_of_reference_m=lane.left_of_reference_m - 1.5,
        )
        for lane in after[1]
    ]
    roads = [
        (msgspec.structs.replace(before[0], to_place="p"), goes_on),
        (msgspec.structs.replace(after[0], from_place="p"), aside),
    ]
    file = written(drawn_world.world(*roads), tmp_path)
    check_closed(file)
    joints = sorted((a[2], b[2]) for a, b in file.joints())
    assert joints == [(-2, -2), (-2, -2), (-1, -1), (-1, -1)]
