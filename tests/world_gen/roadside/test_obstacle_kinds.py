"""What tags say of things beside the road."""

from __future__ import annotations

import pytest

from foretwin.world_gen.roadside.obstacle_kinds import TRAITS, standing_along, standing_at


@pytest.mark.parametrize(
    ("tags", "kind"),
    [
        ({"natural": "tree"}, "tree"),
        ({"highway": "street_lamp"}, "lamp"),
        ({"power": "pole"}, "pole"),
        ({"barrier": "bollard"}, "bollard"),
        ({"barrier": "block"}, "block"),
        ({"amenity": "shelter"}, "shelter"),
        ({"highway": "bus_stop", "shelter": "yes"}, "shelter"),
        ({"highway": "bus_stop"}, None),
        ({"barrier": "gate"}, None),
        ({"natural": "tree", "location": "underground"}, None),
    ],
)
def test_what_stands_at_a_node(tags: dict[str, str], kind: str | None) -> None:
    found = standing_at(tags)
    assert (found.kind if found else None) == kind


@pytest.mark.parametrize(
    ("tags", "kind"),
    [
        ({"barrier": "retaining_wall"}, "wall"),
        ({"barrier": "hedge"}, "hedge"),
        ({"barrier": "jersey_barrier"}, "guard_rail"),
        ({"amenity": "shelter"}, "shelter"),
        ({"amenity": "shelter", "building": "roof"}, None),
        ({"barrier": "kerb"}, None),
        ({"barrier": "wall", "highway": "steps"}, None),
        ({"barrier": "wall", "layer": "-1"}, None),
        ({"barrier": "wall", "height": "0.1"}, None),
    ],
)
def test_what_stands_along_a_way(tags: dict[str, str], kind: str | None) -> None:
    found = standing_along(tags)
    assert (found.kind if found else None) == kind


def test_sizes_are_those_of_the_map_or_defaults() -> None:
    oak = standing_at({"natural": "tree", "circumference": "3.14159", "height": "20 m"})
    assert oak is not None
    assert oak.width_m == pytest.approx(1.0, abs=1e-4)
    assert (oak.height_m.value, oak.height_m.source) == (20.0, "tagged")
    fir = standing_at({"natural": "tree"})
    assert fir is not None
    assert (fir.width_m, fir.height_m.value) == TRAITS["tree"]
    assert fir.height_m.source == "default"
    wall = standing_along({"barrier": "wall", "width": "0,5"})
    assert wall is not None
    assert wall.width_m == 0.5
    typo = standing_along({"barrier": "wall", "width": "300"})
    assert typo is not None
    assert typo.width_m == 5.0
