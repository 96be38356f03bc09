"""A digital elevation model: a raster of heights, and how far it can be trusted."""

from __future__ import annotations

from typing import NamedTuple

import msgspec
import numpy as np
import pyproj

from foretwin.contracts.arrays import Array
from foretwin.contracts.frames import METRES_PER_DEG


class Trust(NamedTuple):
    """What a raster of cells of at least `cell_m` metres is: errors of its heights, in metres."""

    cell_m: float
    noise_m: float


TRUST = (
    # SRTM, 3 arc seconds: 8.7 m at 90 % between two places in Eurasia, 3.7 m of each (Rodriguez,
    # Morris, Belz 2006, A Global Assessment of the SRTM Performance, table 1).
    Trust(50.0, 3.7),
    # One arc second: SRTM's are hardly better; Copernicus's 4 m at 90 % (product handbook 2022).
    Trust(15.0, 2.4),
    # Of national surveys, from aerial pictures, then from laser scans. Chosen.
    Trust(4.0, 1.0),
    Trust(0.0, 0.3),
)
"""Coarsest first: errors of cells taken to be independent."""


class Dem(msgspec.Struct, frozen=True, kw_only=True):
    """Heights (rows, columns) in metres above the sea, NaN where unknown; row 0 is the northmost.

    Samples lie at `first_x` + column · `step_x` and `first_y` + row · `step_y` (negative), in
    degrees east and north of WGS84, or, where `epsg` is given, in the units of that projection.
    """

    name: str
    sha256: str
    heights_m: Array
    first_x: float
    first_y: float
    step_x: float
    step_y: float
    epsg: int | None = None

    @property
    def cell_m(self) -> float:
        """Length of a cell from north to south, in metres; it need not be known well."""
        return abs(self.step_y) * (METRES_PER_DEG if self.epsg is None else 1.0)

    @property
    def noise_m(self) -> float:
        """Standard deviation of a height, independent from cell to cell."""
        return next(row.noise_m for row in TRUST if self.cell_m >= row.cell_m)

    def at(self, lat_deg: Array, lon_deg: Array) -> Array:
        """Return heights (N,) between samples, bilinear; NaN beyond the raster.

        Where some of the four samples around a place are unknown, the others count.
        """
        x, y = np.asarray(lon_deg, dtype=np.float64), np.asarray(lat_deg, dtype=np.float64)
        if self.epsg is not None:
            given = pyproj.Transformer.from_crs("EPSG:4326", f"EPSG:{self.epsg}", always_xy=True)
            x, y = given.transform(x, y)
        column, row = (x - self.first_x) / self.step_x, (y - self.first_y) / self.step_y
        rows, columns = self.heights_m.shape
        # Half a cell beyond its outer samples a raster still holds.
        inside = (column > -0.5) & (column < columns - 0.5) & (row > -0.5) & (row < rows - 0.5)
        column = np.where(inside, np.clip(column, 0.0, columns - 1.0), 0.0)
        row = np.where(inside, np.clip(row, 0.0, rows - 1.0), 0.0)
        left = np.minimum(column.astype(np.intp), max(columns - 2, 0))
        above = np.minimum(row.astype(np.intp), max(rows - 2, 0))
        total, weights = np.zeros(len(x)), np.zeros(len(x))
        for down, share_y in ((0, 1.0 - (row - above)), (1, row - above)):
            for across, share_x in ((0, 1.0 - (column - left)), (1, column - left)):
                height = self.heights_m[
                    np.minimum(above + down, rows - 1), np.minimum(left + across, columns - 1)
                ]
                weight = np.where(np.isnan(height), 0.0, share_x * share_y)
                total += weight * np.nan_to_num(height)
                weights += weight
        known = inside & (weights > 1e-9)
        return np.where(known, total / np.maximum(weights, 1e-9), np.nan)


class DemSet(msgspec.Struct, frozen=True):
    """Tiles that together cover a place; the first that knows a height counts."""

    tiles: tuple[Dem, ...]

    @property
    def name(self) -> str:
        """The files' names."""
        return ", ".join(tile.name for tile in self.tiles)

    @property
    def key(self) -> str:
        """What it is, in short: the same for the same bytes."""
        return " ".join(tile.sha256 for tile in self.tiles)

    @property
    def cell_m(self) -> float:
        """Length of the coarsest cells."""
        return max(tile.cell_m for tile in self.tiles)

    @property
    def noise_m(self) -> float:
        """Standard deviation of a height in the coarsest tile."""
        return max(tile.noise_m for tile in self.tiles)

    def at(self, lat_deg: Array, lon_deg: Array) -> Array:
        """Return heights (N,) in metres above the sea, NaN where no tile knows."""
        found = np.full(len(lat_deg), np.nan)
        for tile in self.tiles:
            lacking = np.isnan(found)
            if not lacking.any():
                break
            found[lacking] = tile.at(np.asarray(lat_deg)[lacking], np.asarray(lon_deg)[lacking])
        return found
