"""A route's file with several lines, and what is said of those that do not count; its junctions."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from foretwin.orchestrator.worlds.choice import choose_junctions, read_route
from foretwin.world_gen.build import build_world
from tests.orchestrator.worlds.tidal_street import TidalStreet

LINES = [[[13.0, 52.0], [13.1, 52.0]], [[13.1, 52.0], [13.2, 52.0], [13.3, 52.0]]]


def file_of(folder: Path, lines: list[list[list[float]]]) -> Path:
    file = folder / "route.geojson"
    file.write_text(json.dumps({"type": "MultiLineString", "coordinates": lines}))
    return file


def test_of_several_lines_it_is_said_which_one_counts(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = file_of(tmp_path, LINES)
    assert read_route(file).tolist() == [[52.0, 13.0], [52.0, 13.1]]
    (said,) = capsys.readouterr().err.splitlines()
    assert (
        said == f"{file} holds 2 lines: the first is the route; route.geojson#1 would be the second"
    )


def test_of_a_line_that_was_chosen_or_is_the_only_one_nothing_is_said(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = file_of(tmp_path, LINES)
    assert len(read_route(file.with_name("route.geojson#1"))) == 3
    assert len(read_route(file.with_name("route.geojson#0"))) == 2
    assert len(read_route(file_of(tmp_path, LINES[1:]))) == 3
    assert capsys.readouterr().err == ""


def test_tidal_roads_run_as_the_route_drives_them_and_without_one_as_drawn(tmp_path: Path) -> None:
    street = TidalStreet(tmp_path)
    found = [choose_junctions(street.map_file, route=way) for way in (street.eastward, None)]

    worlds = [build_world(o.osm, o.graph, *junctions) for o, junctions in found]
    assert [street.headings(world) for world in worlds] == [{"east"}, {"west"}]
