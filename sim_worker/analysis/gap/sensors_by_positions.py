"""Speed and gyro of a drive held against its positions, where these are good enough to."""

from __future__ import annotations

from collections.abc import Collection

import numpy as np

from foretwin.contracts.arrays import Array, Stamps
from foretwin.contracts.drive import GnssFix
from foretwin.contracts.frames import GeoPoint, LocalFrame, local_from_geo
from foretwin.sim_worker.analysis.gap.consistency import gyro_by_course, speed_by_gnss
from foretwin.sim_worker.analysis.gap.findings import Finding, gyro_sensor, speed_sensor
from foretwin.sim_worker.analysis.gap.pairs import sensor_signals
from foretwin.sim_worker.analysis.motion_record import PERIOD_S, MotionRecord

_LEAST_FIXES = 4
_OF_MEDIAN = 1.0 / 0.6745
"""A normal deviation by the median of what is off."""
_DENSE_S, _PRECISE_M = 0.25, 0.15
"""Positions this near to each other and this good may accuse another sensor."""


def are_precise(fixes: Collection[GnssFix]) -> bool:
    """Return whether positions, in time order, are dense and good enough to judge others by: by
    what they say, and by how far they lie beside those around them."""
    if len(fixes) < _LEAST_FIXES:
        return False
    stamps_ns = np.array([fix.stamp_ns for fix in fixes])
    apart_s = float(np.median(np.diff(stamps_ns))) * 1e-9
    std_m = np.median([np.inf if fix.std_m is None else fix.std_m for fix in fixes])
    if apart_s > _DENSE_S or std_m > _PRECISE_M:
        return False
    lat_deg, lon_deg = np.array([(f.position.lat_deg, f.position.lon_deg) for f in fixes]).T
    frame = LocalFrame(GeoPoint(float(lat_deg[0]), float(lon_deg[0])))
    return _scatter_m(stamps_ns, local_from_geo(frame, lat_deg, lon_deg)) <= _PRECISE_M


def _scatter_m(stamps_ns: Stamps, xy_m: Array) -> float:
    """Return how far positions (N, 2) lie beside those around them, as a standard deviation.

    By second differences, of which half are those of a car that goes steadily on.
    """
    apart, step = np.maximum(np.diff(stamps_ns), 1), np.diff(xy_m, axis=0)
    ratio = (apart[1:] / apart[:-1])[:, None]
    beside = (step[1:] - ratio * step[:-1]) / np.sqrt(1.0 + ratio**2 + (1.0 + ratio) ** 2)
    return float(np.median(np.abs(beside))) * _OF_MEDIAN


def accused_sensors(record: MotionRecord, *, antenna_ahead_m: float = 0.0) -> tuple[Finding, ...]:
    """Return which sensors the whole of a drive with precise positions accuses.

    A record of a shorter period than `PERIOD_S`, which has to be a part of it, is thinned.
    """
    every = max(round(PERIOD_S / float(record.time_s[1])), 1)
    thin = MotionRecord._make(column[::every] for column in record)
    course, gyro, ground, wheels = sensor_signals(thin, antenna_ahead_m).values()
    found = (
        speed_sensor(speed_by_gnss(ground, wheels)),
        gyro_sensor(gyro_by_course(course, gyro, ground)),
    )
    return tuple(one for one in found if one is not None)
