"""`foretwin map`: the index and the fetching of maps are there, and refuse in one line."""

from __future__ import annotations

from pathlib import Path

import pytest

from foretwin.orchestrator.commands.cli import run
from foretwin.orchestrator.embedded import MAP_FILE

COVERS = ("foretwin.orchestrator.worlds.indexing",)


def test_a_map_is_indexed_into_a_folder(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["map", "index", str(MAP_FILE), "--folder", str(tmp_path)]) == 0
    (index,) = tmp_path.glob("*.mapindex")
    assert str(index) in capsys.readouterr().out


@pytest.mark.parametrize("area", ["-30.1,44.9,-29.9,45.1", "7.4,43.7,7.5,43.8"])
def test_no_map_server_is_asked_unless_it_is_named(
    area: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(["map", "get", area, "--out", str(tmp_path / "town.osm")]) == 2
    error = capsys.readouterr().err.strip()
    assert "--config" in error
    assert "\n" not in error
    assert not list(tmp_path.iterdir())


def test_a_file_in_the_place_of_the_folder_is_named(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "file"
    file.touch()
    assert run(["map", "index", str(MAP_FILE), "--folder", str(file)]) == 2
    assert capsys.readouterr().err == f"foretwin: {file}: file exists\n"


def test_a_map_that_is_not_there_is_named(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(["map", "index", "no.osm", "--folder", str(tmp_path)]) == 2
    assert capsys.readouterr().err == "foretwin: no.osm: there is no such map file\n"
