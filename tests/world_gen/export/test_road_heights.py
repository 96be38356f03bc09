"""Heights of layers: ramps to bridges, alike in OpenDRIVE and Lanelet2."""

from __future__ import annotations

from pathlib import Path

import msgspec
import numpy as np
import pytest

from foretwin.contracts.world import World
from foretwin.geometry.world_heights import WorldHeights
from foretwin.world_gen.export.road_heights import layered
from tests.world_gen.export import drawn_world
from tests.world_gen.export.lanelet2_file import Read, written
from tests.world_gen.export.test_opendrive import written as written_opendrive


def ramps() -> World:
    """A bridge, a connection of 10 m behind it, a ramp, and a road on the ground."""
    deck = drawn_world.road("deck", [[0, 0], [40, 0]], ahead=[3.0], layer=1)
    ramp = drawn_world.road("ramp", [[50, 0], [90, 0]], ahead=[3.0])
    far = drawn_world.road("far", [[90, 0], [190, 0]], ahead=[3.0])
    under = drawn_world.road("under", [[20, -50], [20, 50]], ahead=[3.0])
    places = {"deck": (None, "p"), "ramp": ("p", "q"), "far": ("q", None), "under": (None, None)}
    roads = []
    for road, lanes in (deck, ramp, far, under):
        start, end = places[road.id]
        placed = msgspec.structs.replace(road, from_place=start, to_place=end)
        roads.append((placed, drawn_world.leading_to(lanes, {"ramp.f0": "far.f0"})))
    joint = drawn_world.connection(
        "deck.f0", "ramp.f0", np.array([[40.0, -1.5], [50.0, -1.5]]), place_id="p"
    )
    return drawn_world.world(*roads, connections=[joint])


def heights_m(found: Read, name: str) -> list[float]:
    """Return the heights of the nodes along the left border of a lanelet."""
    members, _ = found.lanelet(name)
    (left,) = [ref for _, ref, role in members if role == "left"]
    return [float(found.nodes[node]["ele"]) for node in found.ways[left][0]]


def test_a_ramp_takes_as_many_roads_as_its_grade_asks_for(tmp_path: Path) -> None:
    found = written(ramps(), tmp_path)
    assert heights_m(found, "deck.f0") == [5.0, 5.0]
    assert heights_m(found, "deck.f0>ramp.f0") == [5.0, 5.0]
    # 6 % over 40 m are 2.4 m; the rest comes down within 100 m.
    assert heights_m(found, "ramp.f0") == [5.0, 2.6]
    assert heights_m(found, "far.f0") == [2.6, 0.0]
    assert heights_m(found, "under.f0") == [0.0, 0.0]


def test_roads_are_as_high_in_opendrive_as_in_lanelet2(tmp_path: Path) -> None:
    drawn = ramps()
    found, file = written(drawn, tmp_path), written_opendrive(drawn, tmp_path)
    for road in file.roads.values():
        name = road.source if ">" in road.source else f"{road.source}.f0"
        ends = [road.height_m(0.0), road.height_m(road.length_m)]
        assert heights_m(found, name) == pytest.approx(ends, abs=0.001), name


def test_heights_between_the_ends_of_a_ramp(tmp_path: Path) -> None:
    drawn = ramps()
    hills = layered(drawn)
    assert isinstance(hills, WorldHeights)
    ramp = next(lane for lane in drawn.lanes if lane.id == "ramp.f0")
    along = np.array([[x, -1.5] for x in (50.0, 60.0, 70.0, 90.0)])
    # Level at both ends, half of the way down in the middle.
    wanted = [5.0, 5.0 - 2.4 * (3 / 16 - 2 / 64), 3.8, 2.6]
    assert hills.along(ramp, along) == pytest.approx(wanted)


def test_a_world_of_one_layer_is_level() -> None:
    drawn = ramps()
    roads = tuple(msgspec.structs.replace(road, layer=0) for road in drawn.roads)
    assert layered(msgspec.structs.replace(drawn, roads=roads)) is None


def test_what_passes_over_a_border_at_a_node_of_it_stays_apart(tmp_path: Path) -> None:
    """The upper road's right border has a node where the lower one's left border has one."""
    over = drawn_world.road("over", [[-40, 3], [0, 3], [40, 3]], ahead=[3.0], layer=1)
    under = drawn_world.road("under", [[0, -40], [0, 0], [0, 40]], ahead=[3.0])
    found = written(drawn_world.world(over, under), tmp_path)
    assert heights_m(found, "under.f0") == [0.0, 0.0, 0.0]
    assert heights_m(found, "over.f0") == [5.0, 5.0, 5.0]
