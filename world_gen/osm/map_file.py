"""The packings a map file comes in, and what its header holds."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

from foretwin.contracts.world import ATTRIBUTION, DRAWN_ATTRIBUTION, DRAWN_GENERATOR
from foretwin.world_gen.osm.osm_map import LatLonBounds, MapError

HEAD_BYTES = 4096


class MapHeader(NamedTuple):
    """What stands before the objects of a map."""

    attribution: str
    bounds: LatLonBounds | None

    @classmethod
    def of(cls, generator: str, bounds: Sequence[float] | None) -> MapHeader:
        """Return what follows from a file's generator and its south, west, north and east."""
        drawn = generator.startswith(DRAWN_GENERATOR)
        attribution = DRAWN_ATTRIBUTION if drawn else ATTRIBUTION
        return cls(attribution, LatLonBounds(*bounds) if bounds else None)


def format_of(path: Path, head: bytes) -> str:
    """Return osmium's name of a format, judged by the file's first `HEAD_BYTES`, not its name."""
    if head.startswith(b"\x1f\x8b"):
        return "osm.gz"
    if head.startswith(b"BZh"):
        return "osm.bz2"
    if b"OSMHeader" in head[:64]:
        return "pbf"
    if b"<osm" in head:
        return "osm"
    raise MapError(
        f"{path}: not an OSM file (expected OSM XML, plain or packed with gzip or bzip2, or PBF)"
    )


def unreadable(path: Path, error: BaseException) -> MapError:
    """Return the error of a damaged file, in one line."""
    # zlib and bzip2 may give no reason after their colon.
    reason = " ".join(str(error).split()).rstrip(":")
    return MapError(f"{path}: not a readable OSM file, cut off or damaged: {reason}")


def file_fault(path: Path, error: OSError) -> MapError:
    """Return the error of a file that cannot be opened, in one line."""
    if isinstance(error, FileNotFoundError):
        return MapError(f"{path}: there is no such map file")
    if isinstance(error, IsADirectoryError):
        return MapError(f"{path}: is a folder, not a map file")
    return MapError(f"{path}: the map file cannot be read: {error.strerror}")
