"""The list of a map's junctions: what is copied from it is whole, however narrow the terminal."""

from __future__ import annotations

import pytest

from foretwin.orchestrator.commands.intersections import list_intersections
from foretwin.orchestrator.commands.told import print_told
from foretwin.orchestrator.embedded import MAP_FILE


def test_ids_and_places_are_whole_and_nothing_is_cut_away(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("COLUMNS", "60")
    listed = list_intersections(MAP_FILE, route=None)
    print_told(listed, as_json=False)
    said = capsys.readouterr().out

    assert isinstance(listed.body, list)
    assert len(listed.body) > 3
    for junction in listed.body:
        for whole in (junction.id, f"{junction.lat:.6f}", f"{junction.lon:.6f}"):
            assert f" {whole} " in said
    assert "…" not in said
