"""How the roads of an OpenDRIVE file join where they meet."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.world_gen.drawn_maps import AVENUE, STREET, crossing, world_of
from tests.world_gen.export.test_opendrive import written

COVERS = ("foretwin.world_gen.export.opendrive_places",)


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
