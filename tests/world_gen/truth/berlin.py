"""A real drive inside a real OpenStreetMap extract: Berlin, Gendarmenmarkt."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from foretwin.contracts.arrays import Array
from foretwin.contracts.frames import GeoPoint, LocalFrame, geo_from_ecef, local_from_geo

FRAME = LocalFrame(GeoPoint(52.5093, 13.39295))
SOUTH_WEST, NORTH_EAST = GeoPoint(52.5056, 13.3857), GeoPoint(52.5130, 13.4002)
"""What the extract declares to hold."""
_INSIDE_S = ((0.0, 262.7), (643.9, 696.1))


@dataclass(frozen=True, kw_only=True)
class BerlinDrive:
    """The drive's two passages of the map, as they were received, in metres of `frame`."""

    map_file: Path
    frame: LocalFrame
    tracks: list[Array]
    within_m: Array


def berlin_truth(data: Path) -> BerlinDrive:
    """Return the drive: positions of a NovAtel SPAN receiver, with glitches of 0.5 to 2 m."""
    text = data / "drive-berlin-gendarmenmarkt" / "Berlin_Gendarmenmarkt_GT.txt"
    lines = text.read_text(encoding="utf-8").splitlines()
    rows = np.array([[float(value) for value in line.split()[1:5]] for line in lines])
    geo = geo_from_ecef(rows[:, 1:4])
    xy_m = local_from_geo(FRAME, geo[:, 0], geo[:, 1])
    corners = [local_from_geo(FRAME, p.lat_deg, p.lon_deg) for p in (SOUTH_WEST, NORTH_EAST)]
    return BerlinDrive(
        map_file=data / "osm-berlin-mitte" / "berlin-mitte.osm",
        frame=FRAME,
        tracks=[xy_m[(rows[:, 0] >= a) & (rows[:, 0] <= b)] for a, b in _INSIDE_S],
        within_m=np.array(corners),
    )
