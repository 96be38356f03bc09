"""A map of any size, kept as an index on disk, from which routes and places clip what they need."""

from __future__ import annotations

import errno
import hashlib
import os
import sqlite3
import zlib
from collections.abc import Sequence
from pathlib import Path

import msgspec
import numpy as np

from foretwin.contracts.arrays import Array
from foretwin.contracts.frames import METRES_PER_DEG, GeoPoint, LocalFrame
from foretwin.contracts.new_folder import new_folder
from foretwin.contracts.owned_folder import temporary_folder
from foretwin.world_gen.osm.build_map_store import build_map_store
from foretwin.world_gen.osm.clip import clip_map, find_node
from foretwin.world_gen.osm.map_file import file_fault
from foretwin.world_gen.osm.map_tables import FORMAT_VERSION, MapMeta, TableReader
from foretwin.world_gen.osm.opl_stream import Progress
from foretwin.world_gen.osm.osm_map import LatLonBounds, MapError, OsmMap

DAMAGED = (sqlite3.DatabaseError, msgspec.MsgspecError, zlib.error, TypeError)
FRAME_GRID_DEG = 0.5
"""Maps too wide for one frame have one at each point of this grid."""
STRETCH_M = 1000.0


class MapStore:
    """An open index; `MapStore.open` makes it where it is not there yet."""

    def __init__(self, map_file: Path, path: Path) -> None:
        self.map_file = map_file
        self.path = path
        self._tables = TableReader(path)

    @classmethod
    def open(
        cls, map_file: Path, folder: Path | None = None, progress: Progress | None = None
    ) -> MapStore:
        """Open the index of a map file, in the user's cache or in `folder`; build it if need be.

        An index is known by the SHA-256 of the map; it appears complete or not at all, so that
        several processes may build it at once. Raises `MapError` where the map cannot be read.
        """
        folder = folder or default_folder()
        with new_folder(folder):
            return cls._open(map_file, folder, progress)

    @classmethod
    def _open(cls, map_file: Path, folder: Path, progress: Progress | None) -> MapStore:
        digest = _known_digest(map_file, folder)
        if digest is not None:
            path = index_path(folder, digest)
            if path.exists():
                try:
                    return cls(map_file, path)
                except DAMAGED:
                    path.unlink(missing_ok=True)  # damaged on disk: build it anew
        with temporary_folder("building-", within=folder) as part:
            built = part / "index.sqlite"
            try:
                digest = build_map_store(map_file, part, built, progress)
            except sqlite3.OperationalError as error:
                raise MapError(f"{folder}: the map index cannot be written: {error}") from error
            except OSError as error:
                if error.errno not in (errno.ENOSPC, errno.EDQUOT, errno.EFBIG):
                    raise
                raise MapError(f"{folder}: no room for the map index: {error.strerror}") from error
            built.replace(index_path(folder, digest))
        _remember_digest(map_file, folder, digest)
        return cls(map_file, index_path(folder, digest))

    @property
    def meta(self) -> MapMeta:
        """What holds for the whole map."""
        return self._tables.meta

    @property
    def bounds(self) -> LatLonBounds:
        """The map's bounds."""
        return self.meta.bounds

    def clip(self, bounds: LatLonBounds) -> OsmMap:
        """Return the part of the map that touches a box, every way with all its nodes.

        Raises `NoRoadsError` where no road does.
        """
        return self._clip([bounds])

    def clip_route(self, lat_lon_deg: Array, margin_m: float) -> OsmMap:
        """Return the part of the map within some `margin_m` of a line (N, 2) of degrees."""
        return self._clip(route_boxes(lat_lon_deg, margin_m))

    def position_of(self, node: int) -> tuple[float, float] | None:
        """Return latitude and longitude of a node of a way; None where no way has it."""
        try:
            return find_node(self._tables, node)
        except DAMAGED as error:
            raise self._damaged(error) from error

    def _clip(self, areas: Sequence[LatLonBounds]) -> OsmMap:
        box = _around(areas)
        try:
            return clip_map(
                self._tables, areas, box, file=str(self.map_file), frame=self._frame_for(box)
            )
        except DAMAGED as error:
            raise self._damaged(error) from error

    def _damaged(self, error: Exception) -> MapError:
        return MapError(f"{self.path}: the map index is damaged; remove it: {error}")

    def _frame_for(self, box: LatLonBounds) -> LocalFrame:
        if self.meta.origin is not None:
            return LocalFrame(GeoPoint(*self.meta.origin))
        middle = GeoPoint((box.south + box.north) / 2.0, (box.west + box.east) / 2.0)
        lat, lon = (
            round(angle / FRAME_GRID_DEG) * FRAME_GRID_DEG
            for angle in (middle.lat_deg, middle.lon_deg)
        )
        return LocalFrame(GeoPoint(max(-89.5, min(89.5, lat)), lon))

    def close(self) -> None:
        """Close the index."""
        self._tables.close()


def default_folder() -> Path:
    """Return where indexes are kept: the user's cache."""
    base = os.environ.get("XDG_CACHE_HOME")
    return (Path(base) if base else Path.home() / ".cache") / "foretwin" / "maps"


def index_path(folder: Path, sha256: str) -> Path:
    """Return where the index of the map of this SHA-256 is, or would be."""
    return folder / f"{sha256[:32]}-v{FORMAT_VERSION}.mapindex"


def route_boxes(lat_lon_deg: Array, margin_m: float) -> list[LatLonBounds]:
    """Return boxes around stretches of a line (N, 2) of degrees, each with a margin."""
    line = np.asarray(lat_lon_deg, dtype=np.float64).reshape(-1, 2)
    if not len(line) or not np.isfinite(line).all():
        raise ValueError("a route needs one finite position at least")
    boxes: list[LatLonBounds] = []
    begin = 0
    while True:
        scale = np.array([1.0, max(0.01, float(np.cos(np.radians(line[begin, 0]))))])
        away_m = np.abs((line[begin:] - line[begin]) * scale).max(axis=1) * METRES_PER_DEG
        beyond = np.flatnonzero(away_m > STRETCH_M)
        end = begin + (max(int(beyond[0]), 1) if len(beyond) else len(line) - 1 - begin)
        part = line[begin : end + 1]
        margin = margin_m / METRES_PER_DEG / scale
        south, west = (part.min(axis=0) - margin).tolist()
        north, east = (part.max(axis=0) + margin).tolist()
        boxes.append(LatLonBounds(south, west, north, east))
        if end >= len(line) - 1:
            return boxes
        begin = end


def _around(areas: Sequence[LatLonBounds]) -> LatLonBounds:
    if len(areas) == 1:
        return areas[0]
    edges = np.array(areas)
    (south, west), (north, east) = edges[:, :2].min(axis=0), edges[:, 2:].max(axis=0)
    return LatLonBounds(float(south), float(west), float(north), float(east))


def _digest_note(map_file: Path, folder: Path) -> Path:
    """Return the file that keeps the SHA-256 of a map file as long as that is not changed."""
    try:
        stat = map_file.stat()
    except OSError as error:
        raise file_fault(map_file, error) from None
    if map_file.is_dir():
        raise MapError(f"{map_file}: is a folder, not a map file")
    key = f"{map_file.resolve()}|{stat.st_size}|{stat.st_mtime_ns}|{stat.st_ino}"
    return folder / f"{hashlib.sha256(key.encode()).hexdigest()[:32]}.sha256"


def _known_digest(map_file: Path, folder: Path) -> str | None:
    """Return the map's SHA-256 if an index may be there for it; reading it all costs time."""
    note = _digest_note(map_file, folder)
    if note.exists():
        return note.read_text(encoding="ascii").strip()
    if not any(folder.glob(f"*-v{FORMAT_VERSION}.mapindex")):
        return None
    with map_file.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def _remember_digest(map_file: Path, folder: Path, digest: str) -> None:
    note = _digest_note(map_file, folder)
    partial = note.with_suffix(f".{os.getpid()}.part")
    partial.write_text(digest, encoding="ascii")
    partial.replace(note)
