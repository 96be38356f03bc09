"""The picture for people: it shows what it should, names its source, and is the same each time."""

from __future__ import annotations

import hashlib
import re
from pathlib import Path
from xml.etree import ElementTree

import matplotlib.image
import msgspec
import numpy as np
import pytest

from foretwin.contracts.errors import UserError
from foretwin.contracts.world import ATTRIBUTION, World
from foretwin.world_gen.export.picture import write_picture
from foretwin.world_gen.report.report import report_of
from tests.world_gen.drawn_maps import crossing, roundabout, world_of
from tests.world_gen.export.drawn_world import NOTHING_ELSE

COVERS = (
    "foretwin.world_gen.export.picture_ground",
    "foretwin.world_gen.export.picture_marks",
    "foretwin.world_gen.export.picture_style",
    "foretwin.world_gen.export.picture_traffic",
)
HOUSE = {20: (10.0, 10.0), 21: (30.0, 10.0), 22: (30.0, 30.0), 23: (10.0, 30.0)}
BRIDGE = {30: (-60.0, 60.0), 31: (60.0, 60.0)}


@pytest.fixture(scope="module")
def world() -> World:
    return world_of(
        crossing(
            extra_nodes=HOUSE | BRIDGE,
            extra_ways=[
                (20, [20, 21, 22, 23, 20], {"building": "yes", "height": "40"}),
                (30, [30, 31], {"highway": "tertiary", "bridge": "yes", "layer": "1"}),
            ],
        )
    )


def _share(image: np.ndarray, colour: str) -> float:
    rgb = np.array([int(colour[i : i + 2], 16) for i in (1, 3, 5)]) / 255.0
    return float((np.abs(image[..., :3] - rgb).max(axis=-1) < 0.02).mean())


def test_a_picture_shows_road_turns_and_buildings(world, tmp_path):
    path = tmp_path / "world.png"
    write_picture(world, path)
    image = matplotlib.image.imread(path)
    assert image.shape[0] > 1000
    close_up = image[100:1200, :1300]  # without the legend, whose colours are the same
    assert _share(close_up, "#c9ccd1") > 0.03  # road surface
    for turn in ("#2a7f3f", "#1f5fd0", "#d8781a"):  # straight, left, right
        assert _share(close_up, turn) > 5e-5
    assert _share(close_up, "#b26a00") > 1e-5  # who waits
    assert ATTRIBUTION.encode("latin-1") in path.read_bytes()


def _texts(path: Path) -> list[str]:
    root = ElementTree.fromstring(path.read_text(encoding="utf-8"))
    return ["".join(t.itertext()) for t in root.iter("{http://www.w3.org/2000/svg}text")]


def test_a_drawing_names_confidence_source_and_guesses(world, tmp_path):
    path = tmp_path / "world.svg"
    write_picture(world, path)
    texts = _texts(path)
    sure = report_of(world).junctions[0].confidence
    assert any(f"confidence {sure:.2f}" in text for text in texts)
    assert ATTRIBUTION in texts
    for words in ("tagged: said by the map", "gives way by a rule, no sign", "bridge, above"):
        assert words in texts
    assert any(re.match(r"lane counts +0 +0 +4 +0.30", text) for text in texts)


def test_the_same_world_gives_the_same_bytes(world, tmp_path):
    sums = set()
    for name in ("a.svg", "b.svg"):
        write_picture(world, tmp_path / name)
        sums.add(hashlib.sha256((tmp_path / name).read_bytes()).hexdigest())
    assert len(sums) == 1
    assert "<dc:date>" not in (tmp_path / "a.svg").read_text(encoding="utf-8")


def test_a_region_is_drawn_whole(world, tmp_path):
    region = msgspec.structs.replace(
        world,
        bounds_m=(-120.0, -90.0, 120.0, 90.0),
        intersection=msgspec.structs.replace(world.intersection, kind="region", name=""),
    )
    write_picture(region, tmp_path / "region.svg")
    texts = _texts(tmp_path / "region.svg")
    assert any("240 m by 180 m" in text for text in texts)
    assert any("1 junctions" in text for text in texts)
    assert "1" in texts  # the junction's number on the ground
    assert any(re.match(r" +1 0\.\d\d +crossing +uncontrolled", text) for text in texts)


def test_a_world_without_names_and_buildings_can_be_drawn(tmp_path):
    bare = {"highway": "residential"}
    write_picture(world_of(crossing(street=bare, avenue=bare)), tmp_path / "world.svg")
    assert any(
        text.startswith("n0   (crossing, uncontrolled") for text in _texts(tmp_path / "world.svg")
    )


def test_a_roundabout_shows_who_gives_way(tmp_path):
    write_picture(world_of(roundabout()), tmp_path / "ring.svg")
    assert any("(roundabout, right-hand traffic)" in text for text in _texts(tmp_path / "ring.svg"))


def test_a_world_without_anything_can_be_drawn(world, tmp_path):
    network = dict.fromkeys(("lanes", "connections", "junctions", "roads", "conflicts"), ())
    empty = msgspec.structs.replace(world, sidewalks=(), **network, **NOTHING_ELSE)
    write_picture(empty, tmp_path / "empty.svg")
    assert ATTRIBUTION in _texts(tmp_path / "empty.svg")


def test_another_suffix_is_refused(world, tmp_path):
    with pytest.raises(UserError, match=r"world\.jpg: a picture is written as \.png or \.svg"):
        write_picture(world, tmp_path / "world.jpg")
