"""Roofs in MJCF and SDFormat: seen over walls that end at the eaves, and touched by nobody."""

from __future__ import annotations

from functools import cache
from pathlib import Path

import msgspec
import mujoco
import numpy as np
import pytest
from lxml import etree

from foretwin.contracts.world import World
from foretwin.world_gen.export.mjcf import world_spec
from foretwin.world_gen.export.roofs import eaves_m, roofs_mesh
from foretwin.world_gen.export.sdformat import write_sdf
from tests.world_gen.drawn_maps import crossing, world_of


@cache
def village() -> World:
    """Return a crossing with a gabled house and one that is flat."""
    nodes, ways = {}, []
    for first, roof in ((20, {"roof:shape": "gabled", "roof:height": "3"}), (40, {})):
        mine = {first + k: (x + first, y + 20.0) for k, (x, y) in enumerate(_CORNERS)}
        nodes |= mine
        ways.append((first, [*mine, first], {"building": "house", "height": "9", **roof}))
    return world_of(crossing(extra_nodes=nodes, extra_ways=ways))


_CORNERS = ((0.0, 0.0), (12.0, 0.0), (12.0, 8.0), (0.0, 8.0))


def test_walls_end_where_the_roof_begins() -> None:
    gabled, flat = village().buildings
    assert (eaves_m(gabled), eaves_m(flat)) == (6.0, 9.0)
    mesh = roofs_mesh([(gabled, 2.0), (flat, 0.0)])
    assert mesh.points[:, 2].min() == pytest.approx(8.0)
    assert mesh.points[:, 2].max() == pytest.approx(11.0)


def test_two_roofs_are_one_mesh() -> None:
    gabled, _ = village().buildings
    one, both = roofs_mesh([(gabled, 0.0)]), roofs_mesh([(gabled, 0.0), (gabled, 1.0)])
    assert len(both.triangles) == 2 * len(one.triangles)
    second = both.points[both.triangles[len(one.triangles) :]]
    assert np.allclose(second, one.points[one.triangles] + [0.0, 0.0, 1.0])


def test_mujoco_shows_roofs_and_collides_with_blocks() -> None:
    model = world_spec(village()).compile()
    roofs = model.geom("roofs")
    assert (roofs.contype[0], roofs.conaffinity[0]) == (0, 0)
    tops = {
        model.geom(k).name: float(model.geom(k).pos[2] + model.geom(k).size[2])
        for k in range(model.ngeom)
        if model.geom(k).name.startswith("building:")
    }
    assert sorted(tops.values()) == pytest.approx([6.0, 9.0])
    assert model.mesh_vert[:, 2].max() > 0.0
    worker = world_spec(village(), visual=False).compile()
    names = [worker.geom(k).name for k in range(worker.ngeom)]
    assert "roofs" not in names
    assert mujoco.mj_name2id(worker, mujoco.mjtObj.mjOBJ_GEOM, "ground") >= 0


def test_sdformat_has_roofs_in_a_mesh_beside_it(tmp_path: Path) -> None:
    path = tmp_path / "village.sdf"
    write_sdf(village(), path)
    root = etree.parse(path)
    (link,) = root.xpath("//model[@name='roofs']/link")
    assert link.find("collision") is None
    assert link.findtext("visual/geometry/mesh/uri") == "village.roofs.obj"
    lines = (tmp_path / "village.roofs.obj").read_text().splitlines()
    high = [float(line.split()[3]) for line in lines if line.startswith("v ")]
    assert (min(high), max(high)) == (6.0, 9.0)
    heights = root.xpath("//model[@name='buildings']//visual/geometry/box/size/text()")
    assert sorted(float(text.split()[2]) for text in heights) == [6.0, 9.0]


def test_without_roofs_a_world_is_one_file(tmp_path: Path) -> None:
    bare = [msgspec.structs.replace(b, roof=msgspec.UNSET) for b in village().buildings]
    write_sdf(msgspec.structs.replace(village(), buildings=tuple(bare)), tmp_path / "flat.sdf")
    assert [path.name for path in tmp_path.iterdir()] == ["flat.sdf"]
