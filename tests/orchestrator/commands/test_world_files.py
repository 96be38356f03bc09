"""Many Worlds of one map: what goes wrong with one is told, and stops none of the rest."""

from __future__ import annotations

from pathlib import Path

import pytest

from foretwin.contracts.world import World
from foretwin.orchestrator.commands.cli import run
from foretwin.orchestrator.commands.world_files import FAILURES_FILE, write_each
from foretwin.orchestrator.embedded import MAP_FILE, ROUTE_FILE
from foretwin.orchestrator.worlds.opening import open_map
from foretwin.world_gen.build import build_world
from foretwin.world_gen.junctions.intersections import Junction

MAP = str(MAP_FILE)


def test_one_bad_junction_does_not_stop_the_rest(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    opened = open_map(MAP_FILE)
    bad = opened.junctions[1].summary.id

    def build(junction: Junction) -> World:
        if junction.summary.id == bad:
            raise ZeroDivisionError("a road\nwithout length")
        return build_world(opened.osm, opened.graph, junction)

    def write(world: World, path: Path) -> None:
        path.write_text(world.id, encoding="utf-8")

    found = write_each(
        opened.junctions[:3], build, write,
        folder=tmp_path, suffix=".txt", attribution=opened.osm.attribution,
    )  # fmt: skip
    said = capsys.readouterr()
    assert found.code == 3
    assert "2 of 3 Worlds written" in str(found.words)
    assert f"{bad}: ZeroDivisionError: a road without length" in said.err
    listed = (tmp_path / FAILURES_FILE).read_text(encoding="utf-8")
    assert listed == f"{bad}: ZeroDivisionError: a road without length\n"
    assert not (tmp_path / f"{bad}.txt").exists()
    assert len(list(tmp_path.iterdir())) == 3


def test_a_run_without_failures_leaves_no_list_of_an_earlier_one(tmp_path: Path) -> None:
    (tmp_path / FAILURES_FILE).write_text("n1: KeyError: old\n", encoding="utf-8")
    arguments = ["--route", str(ROUTE_FILE), "--format", "geojson", "--out", str(tmp_path)]
    assert run(["world", MAP, *arguments]) == 0
    assert not (tmp_path / FAILURES_FILE).exists()
