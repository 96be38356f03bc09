"""The store of tracks: where the car drove, one file each, the user's own to list and delete."""

from __future__ import annotations

import os
import re
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from foretwin.contracts.codec import SchemaMismatch, read_message, write_message
from foretwin.contracts.errors import UserError
from foretwin.contracts.frames import METRES_PER_DEG
from foretwin.contracts.tracks import DrivenTrack, TrackSet
from foretwin.world_gen.osm.osm_map import LatLonBounds

OWN = "own"
"""Stands for the store of this user."""
SUFFIX = ".track"
_ID = re.compile(r"[0-9a-f]{12}")
_MARGIN_DEG = 100.0 / METRES_PER_DEG


def own_folder() -> Path:
    """Return the folder of this user's tracks: `foretwin/tracks` among the user's data (XDG)."""
    base = os.environ.get("XDG_DATA_HOME")
    return (Path(base) if base else Path.home() / ".local" / "share") / "foretwin" / "tracks"


def store_folder(named: str | None) -> Path:
    """Return the folder that is meant: the user's own by `own` or by nothing."""
    return own_folder() if named in (None, OWN) else Path(str(named))


class TrackStore:
    """A folder of tracks, `<id>.track` each; it may be copied, and files may be taken out."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder

    def ids(self) -> list[str]:
        """Return the ids of all tracks, in order; none where there is no folder yet."""
        names = (path.stem for path in self.folder.glob(f"*{SUFFIX}"))
        return sorted(name for name in names if _ID.fullmatch(name))

    def load(self, track: str) -> DrivenTrack:
        """Read one track; raises UserError where there is none of this id, or it is damaged."""
        path = self._path(track)
        try:
            return read_message(path, DrivenTrack).validate()
        except FileNotFoundError:
            raise UserError(f"{self.folder} holds no track {track}") from None
        except SchemaMismatch as error:
            raise UserError(f"{error}; `foretwin tracks delete {track}` removes it") from error

    def all(self) -> Iterator[DrivenTrack]:
        """Read the tracks one by one."""
        for name in self.ids():
            yield self.load(name)

    def add(self, track: DrivenTrack) -> bool:
        """Keep a track; False where it is there already."""
        self.folder.mkdir(parents=True, exist_ok=True, mode=0o700)
        path = self._path(track.id)
        if path.exists():
            return False
        write_message(track.validate(), path)
        return True

    def delete(self, track: str) -> None:
        """Remove a track; raises UserError where there is none of this id."""
        try:
            self._path(track).unlink()
        except FileNotFoundError:
            raise UserError(f"{self.folder} holds no track {track}") from None

    def _path(self, track: str) -> Path:
        if not _ID.fullmatch(track):
            raise UserError(
                f"track {track}: an id has 12 hex digits, as `foretwin tracks list` shows"
            )
        return self.folder / f"{track}{SUFFIX}"


def tracks_for(bounds: LatLonBounds | None, named: str | None) -> TrackSet | None:
    """Return the tracks that come near a map, where a store is named; None where none do.

    Raises UserError for a folder that is not there, or a damaged track.
    """
    if named is None:
        return None
    folder = store_folder(named)
    if not folder.is_dir():
        raise UserError(f"tracks {folder}: no such folder; `foretwin tracks add LOG` fills a store")
    near = tuple(track for track in TrackStore(folder).all() if _near(track, bounds))
    return TrackSet.of(near) if near else None


def _near(track: DrivenTrack, bounds: LatLonBounds | None) -> bool:
    if bounds is None:
        return True
    margin = _MARGIN_DEG
    inside = (track.lat_deg > bounds.south - margin) & (track.lat_deg < bounds.north + margin)
    wide = margin / max(float(np.cos(np.radians(bounds.north))), 0.01)
    inside &= (track.lon_deg > bounds.west - wide) & (track.lon_deg < bounds.east + wide)
    return bool(inside.any())
