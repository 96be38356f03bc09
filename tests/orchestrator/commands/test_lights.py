"""`foretwin lights`: rows of a mapping, from what exports of a World say of its lights."""

from __future__ import annotations

import tomllib
from pathlib import Path

import pytest

from foretwin.contracts.errors import UserError
from foretwin.orchestrator.commands.lights import light_rows, show_lights
from foretwin.world_gen.export.lanelet2 import lanelet2_map, write_lanelet2
from foretwin.world_gen.export.opendrive import write_opendrive
from tests.orchestrator.trip import town, town_world


def test_the_lights_of_both_exports_of_a_world_make_rows(tmp_path: Path) -> None:
    world = town_world("n44")
    files = [tmp_path / "a.osm", tmp_path / "a.xodr"]
    write_lanelet2(world, files[0])
    write_opendrive(world, files[1])
    told = show_lights(files)
    assert isinstance(told.words, str)
    rows = tomllib.loads(told.words)["light"]
    assert told.body == {"light": rows}
    assert [row["group"] for row in rows] == sorted({one.group_id for one in world.signals})
    assert [(row["intersection"], row["signal_group"]) for row in rows] == [
        (1, number) for number in range(1, len(rows) + 1)
    ]
    numbers = [number for row in rows for key in ("ids", "ways") for number in row[key]]
    assert len(set(numbers)) == len(numbers) == 2 * len(rows)
    assert sorted(one for row in rows for one in row["signals"]) == list(range(1, len(rows) + 1))
    drawn = {number: tags for number, _, tags in lanelet2_map(world)._ways}
    for row in rows:
        (way,) = row["ways"]
        shown = {one.id for one in world.signals if one.group_id == row["group"]}
        assert drawn[way]["foretwin:id"] in shown


def test_a_file_without_lights_is_refused(tmp_path: Path) -> None:
    (tmp_path / "a.osm").write_text("<osm/>")
    (tmp_path / "b.osm").write_text("<osm")
    assert town()
    for name, text in (
        ("a.osm", "names no group"),
        ("b.osm", "no XML: "),
        ("c", "cannot be read: No such file"),
    ):
        with pytest.raises(UserError, match=text):
            light_rows([tmp_path / name])
