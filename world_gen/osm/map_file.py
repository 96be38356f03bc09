"""The packings a map file comes in, and what its header holds."""

from __future__ import annotations

import bz2
import contextlib
import gzip
import zlib
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

from foretwin.contracts.world import ATTRIBUTION, DRAWN_ATTRIBUTION, DRAWN_GENERATOR
from foretwin.world_gen.osm.osm_map import LatLonBounds, MapError

HEAD_BYTES = 4096
MOST_UNPACKED_BYTES = 128 * 2**20
MOST_RATIO = 100
"""A packed map beyond both is a bomb: gzip packs OSM XML 8 to 15 times, bzip2 10 to 25 times; a
bomb of zeros 1,000 times and more."""
_STEP_BYTES = 2**20
MOST_REASON = 500
"""Characters of why a file is no map: a parser quotes what it cannot read, however long."""


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


def check_packing(path: Path, form: str) -> None:
    """Raise MapError for a map that unpacks to far more than any map does; other faults pass."""
    if form not in ("osm.gz", "osm.bz2"):
        return
    opened = gzip.open if form == "osm.gz" else bz2.open
    unpacked, most = 0, max(MOST_UNPACKED_BYTES, MOST_RATIO * path.stat().st_size)
    # Bytes that do not unpack are for the reader to tell of.
    with contextlib.suppress(OSError, EOFError, zlib.error), opened(path) as file:
        while step := len(file.read(_STEP_BYTES)):
            unpacked += step
            if unpacked > most:
                break
    if unpacked > most:
        raise MapError(
            f"{path}: {path.stat().st_size} bytes unpack to more than {most}: no map is packed so"
        )


def unreadable(path: Path, error: BaseException) -> MapError:
    """Return the error of a damaged file, in one line."""
    # zlib and bzip2 may give no reason after their colon.
    reason = " ".join(str(error).split()).rstrip(":")[:MOST_REASON]
    return MapError(f"{path}: not a readable OSM file, cut off or damaged: {reason}")


def file_fault(path: Path, error: OSError) -> MapError:
    """Return the error of a file that cannot be opened, in one line."""
    if isinstance(error, FileNotFoundError):
        return MapError(f"{path}: there is no such map file")
    if isinstance(error, IsADirectoryError):
        return MapError(f"{path}: is a folder, not a map file")
    return MapError(f"{path}: the map file cannot be read: {error.strerror}")
