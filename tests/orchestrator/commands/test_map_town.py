"""The drawn town as files: what `foretwin drive` takes without arguments."""

from __future__ import annotations

from pathlib import Path

import pytest

from foretwin.orchestrator.commands.cli import run
from foretwin.orchestrator.commands.map_town import write_town
from foretwin.orchestrator.embedded import MAP_FILE, ROUTE_FILE


def test_map_and_route_are_those_of_the_town(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(["map", "town", "--out", str(tmp_path / "town.osm")]) == 0

    assert (tmp_path / "town.osm").read_bytes() == MAP_FILE.read_bytes()
    assert (tmp_path / "town.geojson").read_bytes() == ROUTE_FILE.read_bytes()
    assert "invented town" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("name", "told"),
    [("town.pbf", "a file named .osm"), ("nowhere/town.osm", "/nowhere does not exist")],
)
def test_a_wrong_name_is_told(
    name: str, told: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(["map", "town", "--out", str(tmp_path / name)]) == 2
    assert capsys.readouterr().err.endswith(f"{told}\n")
    assert list(tmp_path.iterdir()) == []
    assert write_town(tmp_path / "a.osm").body == {
        "map": tmp_path / "a.osm",
        "route": tmp_path / "a.geojson",
    }
