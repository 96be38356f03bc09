"""Which columns are positions, in what frame: each reading by which a car moves as cars do."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import pyproj

from foretwin.contracts import frames
from foretwin.contracts.arrays import Array, Flags, Indices
from foretwin.contracts.frames import GeoPoint, LocalFrame, geo_from_ecef, local_from_geo
from foretwin.telemetry.logs import units
from foretwin.telemetry.logs.declare.motion import FASTEST_MPS, GridMotion, changes, motion_of
from foretwin.telemetry.logs.declare.names import FEET, called
from foretwin.telemetry.logs.log import LogError

_LEAST_P90_MPS = 1.5
"""A drive is faster than that for a tenth of its time, and never faster than 90 m/s for long."""
_LEAST_WAY_M = 30.0
_ROUGH = 1.6
"""A way from row to row is so much longer than over each fifth: positions are smooth."""
_LEAST_CHANGES = 15
_OWN_TIMES = 0.9
"""So many positions have a time of their own; fewer by a clock that is too coarse for them."""
_TOGETHER, _TOGETHER_COARSE, _FEW_STEPS = 0.6, 0.2, 8.0
"""Columns of one receiver change in the same rows, of all in which one does; in fewer where all but
one are rounded so that they change by a few steps at most: along a street one hardly changes."""
_EVENLY = 0.9
_WHOLE_UNITS, _LEAST_WHOLE = ("1e-7 deg", "1e-6 deg", "1e-5 deg", "mas"), 20_000.0
"""Smaller whole numbers are revolutions and the like: 200 m around where both are nought."""
_IN_PARTS_TOO = ("1e-7 deg", "mas")
_PLAIN_ANGLES, _FEW_WRONG = ("deg", "rad"), 0.01
_BESIDE_DEG = 2.0
"""So far beyond the area in which a projected system is used may a drive lie in it."""
_FAR_M = 3.0e4
"""A plane's zero lies nearer to the drive: what is farther off counts from a grid's."""
_ROWS_LOOKED_AT = 20_000
_EARTH_M, _ELLIPSOID_M = (6.33e6, 6.40e6), (-500.0, 9000.0)
_WITHIN_M = 3.0e5
_UTM_EAST_M, _UTM_NORTH_M = (1.0e5, 9.0e5), (1.2e6, 1.0e7)
"""Eastings are so; northings beyond belong to 11 degrees and more from the equator."""


class Place(NamedTuple):
    """A reading of columns as positions; `fields` name them as a declaration's section does."""

    frame: str
    fields: dict[str, str]
    unit: str
    rows: Indices
    """Those that hold a new position."""
    xy_m: Array
    """Of these rows (R, 2), x east, y north, in a plane of the drive's own."""
    motion: GridMotion
    middle_deg: tuple[float, float] | None
    """Latitude and longitude, where the frame tells them."""
    alike: float
    """Share of changes that all columns have together."""
    centre_m: tuple[float, float] = (0.0, 0.0)
    """Of a plane: where in it the drive's middle lies."""


def places_of(columns: dict[str, Array], time_s: Array) -> list[list[Place]]:
    """Return every reading that moves as a car does, of one kind of frame in each list.

    Where a frame takes much to fit by chance, no other is looked for. `time_s` (N,) may be any
    scale's: a wrong one leaves none, since speeds are no car's.
    """
    lively = {
        name: values
        for name, values in columns.items()
        if len(changes([values])) >= _LEAST_CHANGES and not counts(values)
    }
    new = _Changes(lively)
    if ecef := _ecef(lively, time_s, new):
        return [ecef]
    if utm := _plane(lively, time_s, new, of_utm=True):
        return [utm]
    angles = _geographic(lively, time_s, new)
    # Plain degrees as minutes, and a heading beside them, move as a car does now and then.
    if plain := [place for place in angles if place.unit in _PLAIN_ANGLES]:
        return [plain]
    plane = _plane(lively, time_s, new, of_utm=False)
    return [found for found in (angles, plane) if found]


def in_grid(places: list[Place], epsg: int, time_s: Array) -> list[Place]:
    """Return positions of a projected system where they are on Earth, in true metres.

    Those beyond where the system is used are none. Raises LogError where there is no such system.
    """
    try:
        area = pyproj.CRS.from_epsg(epsg).area_of_use
        convert = pyproj.Transformer.from_crs(epsg, 4326, always_xy=True)
    except pyproj.exceptions.CRSError as error:
        raise LogError(f"EPSG {epsg}: {error}") from None
    found = []
    for place in places:
        lon, lat = convert.transform(*(place.xy_m + place.centre_m).T)
        middle = (float(np.median(lat)), float(np.median(lon)))
        inside = area is None or (
            area.south - _BESIDE_DEG <= middle[0] <= area.north + _BESIDE_DEG
            and area.west - _BESIDE_DEG <= middle[1] <= area.east + _BESIDE_DEG
        )
        if not inside or not np.isfinite([lat, lon]).all():
            continue
        xy_m = local_from_geo(LocalFrame(GeoPoint(*middle)), np.asarray(lat), np.asarray(lon))
        found += _place(
            place.frame, place.fields, place.unit, place.rows, xy_m, time_s, middle, place.alike
        )
    return found


def counts(values: Array) -> bool:
    """Tell whether a column grows by ever the same, as numbers of rows and of messages do."""
    steps = np.diff(values[changes([values])])
    usual = float(np.median(steps))
    return bool(np.mean(np.abs(steps - usual) < 1e-6 * max(abs(usual), 1e-9)) > _EVENLY)


def _geographic(columns: dict[str, Array], time_s: Array, new: _Changes) -> list[Place]:
    found = []
    for unit in units.GEOGRAPHIC_ANGLE:
        fits = {}
        for name, values in columns.items():
            if not _are_whole(values, unit):
                continue
            if unit == units.DDMM and not _are_ddmm(values):
                continue
            # The middle, since (0, 0) is what receivers say without a fix.
            angle = units.degrees_of(values, unit)
            low, high = np.nanpercentile(angle, (5.0, 95.0))
            if low >= -180.0 and high <= 180.0 and 1e-5 < high - low < 4.0:
                fits[name] = angle
        for lat, lon in itertools.permutations(fits, 2):
            if abs(np.nanmedian(fits[lat])) >= 89.0:
                continue
            rows, alike = new.common((lat, lon))
            if alike < _TOGETHER:
                continue
            lat_deg, lon_deg = fits[lat][rows], fits[lon][rows]
            middle = (float(np.nanmedian(lat_deg)), float(np.nanmedian(lon_deg)))
            at = (np.abs(lat_deg - middle[0]) < 3.0) & (np.abs(lon_deg - middle[1]) < 3.0)
            rows, lat_deg, lon_deg = rows[at], lat_deg[at], lon_deg[at]
            east_deg = lon_deg * math.cos(math.radians(middle[0]))
            rough_m = np.stack([east_deg, lat_deg], axis=1) * frames.METRES_PER_DEG
            if not _moves_like_a_car(time_s[rows], rough_m):
                continue
            xy_m = local_from_geo(LocalFrame(GeoPoint(*middle)), lat_deg, lon_deg)
            fields = {"latitude": lat, "longitude": lon}
            found += _place("wgs84", fields, unit, rows, xy_m, time_s, middle, alike)
    if any(place.unit == _IN_PARTS_TOO[0] for place in found):
        return found
    # With decimals they only rival those: alone they are some larger unit's, as speeds would say.
    return [p for p in found if all(_are_whole(columns[n], p.unit, ()) for n in p.fields.values())]


def _are_whole(values: Array, unit: str, in_parts_too: Sequence[str] = _IN_PARTS_TOO) -> bool:
    """Tell whether numbers can be whole parts of degrees; of small ones there may be decimals."""
    known = values[np.isfinite(values)]
    whole = unit in in_parts_too or np.mean(known == np.round(known)) > 1.0 - _FEW_WRONG
    return unit not in _WHOLE_UNITS or bool(whole and abs(np.median(known)) > _LEAST_WHOLE)


def _are_ddmm(values: Array) -> bool:
    """Tell whether numbers can be degrees times a hundred and minutes: never 60 and more."""
    known = np.abs(values[np.isfinite(values)])
    return bool(np.median(known) >= 100.0 and np.mean(known % 100.0 >= 60.0) < _FEW_WRONG)


def _ecef(columns: dict[str, Array], time_s: Array, new: _Changes) -> list[Place]:
    far = {
        name: values
        for name, values in columns.items()
        if np.nanmax(np.abs(values)) < _EARTH_M[1] and np.nanstd(values) < _WITHIN_M
    }
    long = {name for name in far if np.nanmax(np.abs(far[name])) > _EARTH_M[0] / math.sqrt(3.0)}
    found = []
    for names in itertools.combinations(far, 3):
        if long.isdisjoint(names):
            continue
        rows, alike = new.common(names)
        if alike < _TOGETHER:
            continue
        norm = float(np.sqrt(np.median(np.sum([far[name][rows] ** 2 for name in names], axis=0))))
        if not _EARTH_M[0] < norm < _EARTH_M[1]:
            continue
        for order in itertools.permutations(names):
            xyz = np.stack([far[name][rows] for name in order], axis=1)
            geo = geo_from_ecef(xyz)
            middle = (float(np.median(geo[:, 0])), float(np.median(geo[:, 1])))
            if not _ELLIPSOID_M[0] < np.median(geo[:, 2]) < _ELLIPSOID_M[1]:
                continue
            xy_m = local_from_geo(LocalFrame(GeoPoint(*middle)), geo[:, 0], geo[:, 1])
            if _moves_like_a_car(time_s[rows], xy_m):
                fields = dict(zip("xyz", order, strict=True))
                found += _place("ecef", fields, "m", rows, xy_m, time_s, middle, alike)
    return found


def _plane(columns: dict[str, Array], time_s: Array, new: _Changes, *, of_utm: bool) -> list[Place]:
    """Return readings as UTM or the like; or those as another grid, else as lengths from somewhere.

    They are feet where they are called so, else metres; the latter may be km, cm or mm.
    """
    grid: list[Place] = []
    near: list[Place] = []
    for east, north in itertools.permutations(columns, 2):
        rows, alike = new.common((east, north))
        if alike < _TOGETHER:
            continue
        raw = np.stack([columns[east][rows], columns[north][rows]], axis=1)
        feet = FEET.search(east) and FEET.search(north)
        for unit in ("ft",) if feet else ("m", "km", "cm", "mm"):
            xy_m = raw * units.LENGTH[unit]
            x_m, y_m = (float(value) for value in np.median(xy_m, axis=0))
            in_east = unit in ("m", "ft") and _UTM_EAST_M[0] < x_m < _UTM_EAST_M[1]
            if (in_east and _UTM_NORTH_M[0] < y_m < _UTM_NORTH_M[1]) != of_utm:
                continue
            kind, fields, found = "projected", {"easting": east, "northing": north}, grid
            if math.hypot(x_m, y_m) < _FAR_M:
                kind, fields, found = "local", {"x": east, "y": north}, near
                if not called(fields):  # any two are a way in some unit, as a speed and a course
                    continue
            elif unit not in ("m", "ft"):
                continue
            if _moves_like_a_car(time_s[rows], xy_m):
                places = _place(kind, fields, unit, rows, xy_m - (x_m, y_m), time_s, None, alike)
                found += [place._replace(centre_m=(x_m, y_m)) for place in places]
    return grid or near


def _place(
    frame: str, fields: dict[str, str], unit: str, rows: Indices, xy_m: Array, time_s: Array,
    middle: tuple[float, float] | None, alike: float,
) -> list[Place]:  # fmt: skip
    rises = np.concatenate([[True], np.diff(np.maximum.accumulate(time_s[rows])) > 0.0])
    rows, xy_m = rows[rises], xy_m[rises]
    motion = motion_of(time_s[rows], xy_m)
    if motion is None or not motion.moves.any():
        return []
    return [Place(frame, fields, unit, rows, xy_m, motion, middle, alike)]


class _Changes:
    """Which rows of each column hold something new, looked for once."""

    def __init__(self, columns: dict[str, Array]) -> None:
        self._known = {name: np.isfinite(values) for name, values in columns.items()}
        self._new: dict[str, Flags] = {}
        self._coarse: dict[str, bool] = {}
        for name, values in columns.items():
            new = np.zeros(len(values), dtype=bool)
            rows = changes([values])
            new[rows] = True
            self._new[name] = new
            steps = np.abs(np.diff(values[rows]))
            self._coarse[name] = bool(np.median(steps) < _FEW_STEPS * steps.min())

    def common(self, names: Sequence[str]) -> tuple[Indices, float]:
        """Return the rows in which any is new and all are known; and how many are new in all."""
        any_new = np.any([self._new[name] for name in names], axis=0)
        all_new = np.all([self._new[name] for name in names], axis=0)
        alike = float(all_new.sum() / max(any_new.sum(), 1))
        coarse = sum(self._coarse[name] for name in names)
        if alike >= _TOGETHER_COARSE and coarse >= len(names) - 1:
            alike = max(alike, _TOGETHER)
        if alike < _TOGETHER:
            return np.zeros(0, dtype=np.intp), alike
        known = np.all([self._known[name] for name in names], axis=0)
        return np.flatnonzero(known & any_new), alike


def _moves_like_a_car(time_s: Array, xy_m: Array) -> bool:
    known = np.flatnonzero(np.isfinite(time_s))
    known = known[:: max(len(known) // _ROWS_LOOKED_AT, 1)]
    time_s, xy_m = time_s[known], xy_m[known]
    if len(time_s) < _LEAST_CHANGES:
        return False
    step_s = np.diff(time_s)
    step_m = np.hypot(*np.diff(xy_m, axis=0).T)
    good = step_s > 0.0
    if good.sum() < _LEAST_CHANGES or good.mean() < _OWN_TIMES:
        return False
    speed = step_m[good] / step_s[good]
    fast_mps = float(np.percentile(speed, 90))
    fifth = np.hypot(*(xy_m[5:] - xy_m[:-5]).T)
    lasts_s = time_s[5:] - time_s[:-5]
    far = fifth > np.percentile(fifth, 50)
    along = np.convolve(step_m, np.ones(5), mode="valid")
    return bool(
        _LEAST_P90_MPS < fast_mps < FASTEST_MPS
        and step_m.sum() > _LEAST_WAY_M
        and (lasts_s[far] > 0.0).any()
        and np.median(along[far] / fifth[far]) < _ROUGH
    )
