"""The store of tracks: the user's own, found again whole, listed and deleted."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from foretwin.contracts.errors import UserError
from foretwin.orchestrator.worlds.track_store import TrackStore, store_folder, tracks_for
from foretwin.world_gen.osm.osm_map import LatLonBounds
from tests.world_gen.driven.drives import track

HERE = track(np.array([[0.0, 0.0], [100.0, 0.0]]))
THERE = track(np.array([[9000.0, 0.0], [9100.0, 0.0]]))
AROUND = LatLonBounds(53.49, 8.09, 53.51, 8.11)


def test_a_track_is_kept_once_and_found_as_it_was(tmp_path: Path) -> None:
    store = TrackStore(tmp_path / "tracks")

    assert store.add(HERE)
    assert not store.add(HERE)

    assert store.ids() == [HERE.id]
    assert np.array_equal(store.load(HERE.id).lat_deg, HERE.lat_deg)
    assert (tmp_path / "tracks").stat().st_mode & 0o077 == 0


def test_a_track_that_was_deleted_is_gone(tmp_path: Path) -> None:
    store = TrackStore(tmp_path)
    store.add(HERE)
    store.delete(HERE.id)

    assert list(tmp_path.iterdir()) == []
    with pytest.raises(UserError, match="holds no track"):
        store.delete(HERE.id)


@pytest.mark.parametrize("name", ["../../etc/passwd", "", "ABCDEF012345", "0" * 13])
def test_what_is_no_id_reaches_no_file(name: str, tmp_path: Path) -> None:
    with pytest.raises(UserError, match="12 hex digits"):
        TrackStore(tmp_path).delete(name)


def test_a_damaged_track_is_named_with_what_removes_it(tmp_path: Path) -> None:
    store = TrackStore(tmp_path)
    store.add(HERE)
    file = tmp_path / f"{HERE.id}.track"
    file.write_bytes(file.read_bytes()[:200])

    with pytest.raises(UserError, match=f"tracks delete {HERE.id}"):
        tracks_for(AROUND, str(tmp_path))


def test_a_map_takes_the_tracks_near_it(tmp_path: Path) -> None:
    store = TrackStore(tmp_path)
    store.add(HERE)
    store.add(THERE)

    found = tracks_for(AROUND, str(tmp_path))

    assert found is not None
    assert [one.id for one in found.tracks] == [HERE.id]
    assert tracks_for(LatLonBounds(10.0, 10.0, 11.0, 11.0), str(tmp_path)) is None
    assert tracks_for(AROUND, None) is None


def test_the_own_store_lies_among_the_users_data(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setenv("XDG_DATA_HOME", str(tmp_path))

    assert store_folder("own") == store_folder(None) == tmp_path / "foretwin" / "tracks"
    with pytest.raises(UserError, match="tracks add LOG"):
        tracks_for(AROUND, "own")
