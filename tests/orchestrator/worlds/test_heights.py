from pathlib import Path

import pytest

from foretwin.contracts.errors import UserError
from foretwin.orchestrator.embedded import MAP_FILE
from foretwin.orchestrator.worlds.heights import heights_for
from foretwin.orchestrator.worlds.opening import open_map


def test_where_no_elevation_is_named_the_ground_is_flat() -> None:
    assert heights_for(open_map(MAP_FILE), None) is None


def test_tiles_of_another_place_are_refused(tmp_path: Path) -> None:
    (tmp_path / "S34W071.hgt").write_bytes(b"\0" * 2 * 1201 * 1201)

    with pytest.raises(UserError, match="knows no height between"):
        heights_for(open_map(MAP_FILE), tmp_path)
