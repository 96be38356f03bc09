"""Where the sun stood: daylight, twilight or night, from time and place alone."""

from __future__ import annotations

import datetime
import math
from typing import Literal, NamedTuple

Light = Literal["day", "low_sun", "twilight", "night"]
_J2000 = datetime.datetime(2000, 1, 1, 12, tzinfo=datetime.UTC)
_LOW_DEG, _SETS_DEG, _NIGHT_DEG = 10.0, -0.833, -6.0
"""Chosen: below 10° it dazzles. It sets at -50' (refraction and its half width), and civil twilight
ends at -6°: The Astronomical Almanac's definitions, as commonly told."""


class SunPlace(NamedTuple):
    """Elevation above the horizon, without refraction, and azimuth clockwise from true north."""

    elevation_deg: float
    azimuth_deg: float

    @property
    def light(self) -> Light:
        """What light that is under a clear sky."""
        if self.elevation_deg >= _LOW_DEG:
            return "day"
        if self.elevation_deg >= _SETS_DEG:
            return "low_sun"
        return "twilight" if self.elevation_deg >= _NIGHT_DEG else "night"


def sun_at(stamp_ns: int, lat_deg: float, lon_deg: float) -> SunPlace:
    """Return where the sun stands at a UTC stamp.

    The low-precision formulas of The Astronomical Almanac, as Michalsky (1988) gives them in Solar
    Energy 40 (3): within 0.01° from 1950 to 2050, more than any use here asks for.
    """
    moment = datetime.datetime.fromtimestamp(stamp_ns * 1e-9, datetime.UTC)
    days = (moment - _J2000).total_seconds() / 86400.0
    mean_longitude = math.radians((280.460 + 0.9856474 * days) % 360.0)
    anomaly = math.radians((357.528 + 0.9856003 * days) % 360.0)
    longitude = mean_longitude + math.radians(
        1.915 * math.sin(anomaly) + 0.020 * math.sin(2.0 * anomaly)
    )
    tilt = math.radians(23.439 - 4e-7 * days)
    right_ascension = math.atan2(math.cos(tilt) * math.sin(longitude), math.cos(longitude))
    declination = math.asin(math.sin(tilt) * math.sin(longitude))
    midnight = days + 0.5 - math.floor(days + 0.5)
    sidereal_h = 6.697375 + 0.0657098242 * days + midnight * 24.0
    hour_angle = math.radians((sidereal_h * 15.0 + lon_deg) % 360.0) - right_ascension
    lat = math.radians(lat_deg)
    elevation = math.asin(
        math.sin(lat) * math.sin(declination)
        + math.cos(lat) * math.cos(declination) * math.cos(hour_angle)
    )
    azimuth = math.atan2(
        -math.sin(hour_angle),
        math.tan(declination) * math.cos(lat) - math.sin(lat) * math.cos(hour_angle),
    )
    return SunPlace(math.degrees(elevation), math.degrees(azimuth) % 360.0)
