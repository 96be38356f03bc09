"""Which ways lead through a place where roads meet."""

from __future__ import annotations

import pytest

from foretwin.contracts.world import World
from tests.world_gen.drawn_maps import GERMANY, IRELAND, roundabout, world_of


def reached(world: World, way: int) -> set[int]:
    """Return the ways by which cars can leave that come from one."""
    after = {lane.id: lane.successor_ids for lane in world.lanes}
    after |= {c.id: (c.to_lane_id,) for c in world.connections}
    way_of = {lane.id: lane.osm_way for lane in world.lanes}
    ahead = [lane.id for lane in world.lanes if lane.osm_way == way and lane.role == "approach"]
    seen: set[str] = set()
    while ahead:
        name = ahead.pop()
        if name not in seen:
            seen.add(name)
            ahead += after[name]
    return {way_of[name] for name in seen if name in way_of and not after[name]}


@pytest.mark.parametrize("left", [False, True])
@pytest.mark.parametrize("radius_m", [2.5, 4.0, 15.0])
def test_a_ring_leads_on_past_its_exits_however_small_it_is(radius_m: float, left: bool) -> None:
    origin = IRELAND if left else GERMANY
    world = world_of(roundabout(origin=origin, clockwise=left, radius_m=radius_m))

    for way in (11, 12, 13):
        assert reached(world, way) == {11, 12, 13}
