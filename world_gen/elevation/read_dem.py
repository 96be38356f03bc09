"""Elevation models from files: SRTM tiles (.hgt, .hgt.zip, .hgt.gz) and GeoTIFF."""

from __future__ import annotations

import gzip
import hashlib
import math
import re
import warnings
import zipfile
import zlib
from pathlib import Path
from typing import Any

import numpy as np

from foretwin.contracts.arrays import Array
from foretwin.contracts.errors import UserError
from foretwin.world_gen.elevation.dem import Dem, DemSet
from foretwin.world_gen.osm.osm_map import LatLonBounds

SUFFIXES = (".hgt", ".hgt.zip", ".hgt.gz", ".tif", ".tiff")
_TILE = re.compile(r"([NS])(\d{2})([EW])(\d{3})", re.IGNORECASE)
_SIDES = (1201, 3601)
"""Samples on a side of SRTM tiles of 3 and of 1 arc second."""
_TILE_MARGIN_DEG = 0.001
"""So far beyond its corners a tile may still hold: more than half a cell."""
_VOID = -32768
_MOST_BYTES = 2 * 3601 * 3601
_MOST_CELLS = 400_000_000
_HEIGHTS_M = (-500.0, 9000.0)
"""Heights of ground lie between; else a file is of something else, or void."""
_PIXEL_SCALE, _TIE_POINT, _TRANSFORM, _GEO_KEYS, _NO_DATA = 33550, 33922, 34264, 34735, 42113
_GEOGRAPHIC, _RASTER_TYPE, _PROJECTED = 2048, 1025, 3072
_LIKE_WGS84 = (4326, 4979, 4258, 4269)
"""Within a metre of WGS84, which is nothing to a cell."""


def read_dem(path: Path, *, around: LatLonBounds | None = None) -> DemSet:
    """Read an elevation file, or those of a folder that reach into bounds `around`.

    Tiles whose names say that they lie elsewhere are not opened.
    Raises UserError, in one line, for what is none, says not where it lies, or lies elsewhere.
    """
    files = _files(path)
    if around is None:
        return DemSet(tuple(_read(file) for file in files))
    lat, lon = np.linspace(around.south, around.north, 9), np.linspace(around.west, around.east, 9)
    lat, lon = (grid.ravel() for grid in np.meshgrid(lat, lon))
    # One by one: a continent's tiles do not fit into memory.
    near = (_read(file) for file in files if not _elsewhere(file, lat, lon))
    tiles = tuple(tile for tile in near if not np.isnan(tile.at(lat, lon)).all())
    if not tiles:
        raise UserError(
            f"dem {path}: knows no height between {around.south:g}, {around.west:g} and "
            f"{around.north:g}, {around.east:g}, where the map is"
        )
    return DemSet(tiles)


def dem_digest(path: Path) -> str:
    """Return what an elevation file, or those of a folder, are: the same for the same bytes.

    It is the `key` of all that `read_dem` can read there; raises UserError where nothing is.
    """
    return " ".join(_digest(file) for file in _files(path))


def _digest(path: Path) -> str:
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def _files(path: Path) -> list[Path]:
    if path.is_dir():
        files = sorted(p for p in path.iterdir() if p.name.lower().endswith(SUFFIXES))
        if not files:
            raise UserError(f"dem {path}: the folder holds no file that ends in {_words()}")
        return files
    if not path.is_file():
        raise UserError(f"dem {path}: no such file")
    return [path]


def _words() -> str:
    return ", ".join(SUFFIXES)


def _read(path: Path) -> Dem:
    name = path.name.lower()
    try:
        if name.endswith((".tif", ".tiff")):
            return _geotiff(path)
        if name.endswith(SUFFIXES):
            return _hgt(path)
    except (OSError, ValueError, zipfile.BadZipFile, zlib.error, EOFError, KeyError) as error:
        raise UserError(f"dem {path}: cannot be read: {' '.join(str(error).split())}") from error
    raise UserError(f"dem {path}: ends in none of {_words()}")


def _corner(name: str) -> tuple[int, int] | None:
    """Return latitude and longitude of the south-western corner of the tile of that name."""
    place = _TILE.match(name)
    if place is None:
        return None
    south = int(place[2]) * (1 if place[1].upper() == "N" else -1)
    return south, int(place[4]) * (1 if place[3].upper() == "E" else -1)


def _elsewhere(path: Path, lat_deg: Array, lon_deg: Array) -> bool:
    """Tell whether a file's name says that it is a tile that reaches none of the places."""
    corner = _corner(path.name) if ".hgt" in path.name.lower() else None
    if corner is None:
        return False
    south, west = (value - _TILE_MARGIN_DEG for value in corner)
    side = 1.0 + 2.0 * _TILE_MARGIN_DEG
    inside = (lat_deg >= south) & (lat_deg <= south + side)
    return not bool((inside & (lon_deg >= west) & (lon_deg <= west + side)).any())


def _hgt(path: Path) -> Dem:
    """Read a tile of big-endian heights from north to south; its name says where it lies."""
    data, inner = path.read_bytes(), path.name
    digest = hashlib.sha256(data).hexdigest()
    if path.suffix.lower() == ".zip":
        with zipfile.ZipFile(path) as archive:
            tiles = [i for i in archive.infolist() if i.filename.lower().endswith(".hgt")]
            if len(tiles) != 1:
                raise UserError(f"dem {path}: holds {len(tiles)} .hgt files; one is needed")
            if tiles[0].file_size > _MOST_BYTES:
                raise UserError(f"dem {path}: {tiles[0].filename} is larger than any SRTM tile")
            data, inner = archive.read(tiles[0]), Path(tiles[0].filename).name
    elif path.suffix.lower() == ".gz":
        with gzip.open(path) as file:
            data = file.read(_MOST_BYTES + 1)
    corner = _corner(path.name) or _corner(inner)
    if corner is None:
        raise UserError(f"dem {path}: the name says not where it lies, as N43E007.hgt does")
    side = math.isqrt(len(data) // 2)
    if side not in _SIDES or len(data) != 2 * side * side:
        raise UserError(
            f"dem {path}: {len(data)} bytes are no SRTM tile of "
            f"{' or '.join(str(2 * known * known) for known in _SIDES)}"
        )
    raw = np.frombuffer(data, dtype=">i2").reshape(side, side)
    south, west = corner
    step = 1.0 / (side - 1)
    return Dem(
        name=path.name,
        sha256=digest,
        heights_m=_known(raw.astype(np.float64), float(_VOID)),
        first_x=float(west),
        first_y=south + 1.0,
        step_x=step,
        step_y=-step,
    )


def _known(heights: Array, void: float | None) -> Array:
    low, high = _HEIGHTS_M
    unknown = ~((heights > low) & (heights < high))
    if void is not None:
        unknown |= heights == void
    return np.where(unknown, np.nan, heights)


def _geotiff(path: Path) -> Dem:
    """Read a GeoTIFF of one band (OGC 19-008r4), north up, geographic or by an EPSG number."""
    from PIL import Image

    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of tags that nobody needs
        image = Image.open(path)
    with image:
        tags: Any = getattr(image, "tag_v2", {})
        if _GEO_KEYS not in tags or _PIXEL_SCALE not in tags or _TIE_POINT not in tags:
            raise UserError(
                f"dem {path}: a TIFF that says not where it lies; a GeoTIFF with a pixel scale, a "
                "tie point and geographic keys is needed"
            )
        if _TRANSFORM in tags:
            raise UserError(f"dem {path}: is turned; a GeoTIFF with north up is needed")
        if image.width * image.height > _MOST_CELLS:
            raise UserError(f"dem {path}: {image.width} by {image.height} cells; cut out a part")
        heights = np.asarray(image, dtype=np.float64)
    if heights.ndim != 2:
        raise UserError(f"dem {path}: a picture of {heights.shape[2]} bands; one is needed")
    void = str(tags.get(_NO_DATA, "")).strip("\0 ")
    keys = np.array(tags[_GEO_KEYS]).reshape(-1, 4)[1:]
    values = {int(key): int(value) for key, where, _, value in keys if where == 0}
    epsg = values.get(_PROJECTED)
    if epsg is None and values.get(_GEOGRAPHIC, 4326) not in _LIKE_WGS84:
        epsg = values[_GEOGRAPHIC]
    if epsg is not None and not 1024 <= epsg < 32767:
        raise UserError(f"dem {path}: names no projection by an EPSG number")
    scale_x, scale_y = tags[_PIXEL_SCALE][:2]
    column, row, _, x, y, _ = tags[_TIE_POINT][:6]
    # A pixel that is an area has its height in the middle.
    half = 0.0 if values.get(_RASTER_TYPE, 1) == 2 else 0.5
    return Dem(
        name=path.name,
        sha256=_digest(path),
        heights_m=_known(heights, float(void) if void else None),
        first_x=float(x + (half - column) * scale_x),
        first_y=float(y - (half - row) * scale_y),
        step_x=float(scale_x),
        step_y=-float(scale_y),
        epsg=epsg,
    )
