"""What the builder makes of what only the drive knows."""

from __future__ import annotations

from pathlib import Path

from foretwin.orchestrator.config import DriveConfig
from foretwin.orchestrator.drive.plan import make_plan, read_inputs
from foretwin.world_gen.opening import open_map
from tests.orchestrator.trip import NOW
from tests.orchestrator.worlds.asked_builder import built
from tests.orchestrator.worlds.tidal_street import TidalStreet


def test_a_tidal_road_has_its_lanes_as_the_route_drives_it(tmp_path: Path) -> None:
    street = TidalStreet(tmp_path)
    config = DriveConfig(
        view="none",
        map=str(street.map_file),
        route=str(street.eastward),
        out=str(tmp_path / "runs"),
        cache_dir=str(tmp_path / "cache"),
    )
    plan = make_plan(read_inputs(config.validate()), NOW)

    assert street.headings(built(plan, "n2")) == {"east"}


def test_without_a_route_a_tidal_road_is_open_both_ways(tmp_path: Path) -> None:
    street = TidalStreet(tmp_path)
    opened = open_map(street.map_file, tides=False)

    assert opened.with_tides(()) is opened
    assert all(edge.forward and edge.backward for edge in opened.graph.edges)
