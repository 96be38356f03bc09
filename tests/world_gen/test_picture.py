"""The picture for people: it exists, shows what it should, and names its source."""

from __future__ import annotations

import matplotlib.image
import numpy as np

from contracts.world import ATTRIBUTION
from tests.world_gen.drawn_maps import crossing, world_of
from world_gen.export.picture import write_picture


def _share(image: np.ndarray, colour: str) -> float:
    rgb = np.array([int(colour[i : i + 2], 16) for i in (1, 3, 5)]) / 255.0
    return float((np.abs(image[..., :3] - rgb).max(axis=-1) < 0.02).mean())


def test_a_picture_shows_road_turns_and_buildings(tmp_path):
    osm = crossing(
        extra_nodes={20: (10.0, 10.0), 21: (30.0, 10.0), 22: (30.0, 30.0), 23: (10.0, 30.0)},
        extra_ways=[(20, [20, 21, 22, 23, 20], {"building": "yes", "height": "40"})],
    )
    path = tmp_path / "world.png"
    write_picture(world_of(osm), path)
    image = matplotlib.image.imread(path)
    assert image.shape[0] > 1000
    close_up = image[120:1200, :1200]  # without the legend, whose colours are the same
    assert _share(close_up, "#c9ccd1") > 0.03  # road surface
    for turn in ("#2a7f3f", "#1f5fd0", "#d8781a"):  # straight, left, right
        assert _share(close_up, turn) > 5e-5
    assert ATTRIBUTION.encode("latin-1") in path.read_bytes()


def test_a_world_without_names_and_buildings_can_be_drawn(tmp_path):
    bare = {"highway": "residential"}
    write_picture(world_of(crossing(street=bare, avenue=bare)), tmp_path / "world.png")
    assert (tmp_path / "world.png").stat().st_size > 10_000
