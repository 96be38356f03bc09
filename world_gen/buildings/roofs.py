"""What a building's tags say of its roof: its form, how high it is, and where its ridge points.

Keys as in https://wiki.openstreetmap.org/wiki/Simple_3D_Buildings. Forms that are drawn by no
rule (`many`, `saltbox`) and flat ones are no roofs here.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import NamedTuple

import msgspec
import numpy as np
import shapely

from foretwin.contracts.arrays import Array
from foretwin.contracts.beside_road import Roof, RoofForm
from foretwin.contracts.provenance import Provenance, Quantity
from foretwin.world_gen.buildings.tags import HEADROOM_M, LEVEL_HEIGHT_M, count_of, height_in_m

_FORMS: dict[str, RoofForm] = {
    "gabled": "gabled",
    "pitched": "gabled",
    "hipped": "hipped",
    "half-hipped": "half_hipped",
    "pyramidal": "pyramidal",
    "skillion": "skillion",
    "lean_to": "skillion",
    "gambrel": "gambrel",
    "mansard": "mansard",
    "round": "round",
    "dome": "dome",
    "onion": "dome",
}
_NORTH_TO_SOUTH = ("N", "NNE", "NE", "ENE", "E", "ESE", "SE", "SSE")
_POINTS = (*_NORTH_TO_SOUTH, "S", "SSW", "SW", "WSW", "W", "WNW", "NW", "NNW")
_DEFAULT_SLOPE = 0.6
"""Height over half the width where no tag tells it: a pitch of 31°. Chosen."""
_LEAST_M = 0.3
"""Lower roofs are flat."""


class RoofTags(NamedTuple):
    """A roof as tagged: height or slope (rise over run), and where it faces or how its ridge lies.

    `faces_rad` is the direction in which a side falls, counter-clockwise from east.
    """

    form: RoofForm
    height: Quantity | None
    slope: float | None
    faces_rad: float | None
    across: bool


def roof_tags(tags: Mapping[str, str]) -> RoofTags | None:
    """Return what tags say of a roof, None where it is flat or of no form that is drawn."""
    form = _FORMS.get(tags.get("roof:shape", ""))
    if form is None:
        return None
    height = None
    if stated := height_in_m(tags.get("roof:height")):
        height = Quantity(stated, "tagged")
    elif levels := count_of(tags.get("roof:levels")):
        height = Quantity(levels * LEVEL_HEIGHT_M, "inferred")
    return RoofTags(
        form=form,
        height=height,
        slope=_slope(tags.get("roof:angle")),
        faces_rad=_direction(tags.get("roof:direction") or tags.get("roof:slope:direction")),
        across=tags.get("roof:orientation") == "across",
    )


def _slope(text: str | None) -> float | None:
    angle_deg = count_of(text)
    return math.tan(math.radians(angle_deg)) if angle_deg and angle_deg < 80.0 else None


def _direction(text: str | None) -> float | None:
    """Return a direction such as `212` or `NNE` counter-clockwise from east, None if it is none."""
    if not text:
        return None
    if text.strip().upper() in _POINTS:
        bearing_deg = 360.0 / len(_POINTS) * _POINTS.index(text.strip().upper())
    else:
        try:
            bearing_deg = float(text.replace("°", ""))
        except ValueError:
            return None
    return math.radians(90.0 - bearing_deg) if math.isfinite(bearing_deg) else None


def roof_over(
    outline: Array, tags: RoofTags | None, *, height_m: float, min_height_m: float
) -> Roof | msgspec.UnsetType:
    """Return the roof of a building with an outline (N, 2) in the World's frame.

    Without a direction the ridge lies along the longer side, as mappers mean it. Walls stay so
    high that a car meets them and never the roof.
    """
    most_m = height_m - max(min_height_m, HEADROOM_M)
    if tags is None or most_m < _LEAST_M:
        return msgspec.UNSET
    long, across_m = _longer_side(outline)
    ridge = long + (math.pi / 2.0 if tags.across else 0.0)
    if tags.faces_rad is not None:
        ridge = tags.faces_rad - math.pi / 2.0
    run_m = across_m if tags.form == "skillion" else across_m / 2.0
    source: Provenance = "inferred" if tags.slope else "default"
    height = tags.height or Quantity(round((tags.slope or _DEFAULT_SLOPE) * run_m, 3), source)
    if height.value > most_m:
        height = Quantity(round(most_m, 3), "default")
    if height.value < _LEAST_M:
        return msgspec.UNSET
    return Roof(form=tags.form, height_m=height, ridge_rad=round(ridge % math.tau, 4))


def _longer_side(outline: Array) -> tuple[float, float]:
    """Return the direction of the smallest rectangle's longer side, and the other's length."""
    ring = shapely.get_coordinates(shapely.oriented_envelope(shapely.Polygon(outline)))
    sides = np.diff(ring[:3], axis=0)
    lengths = np.hypot(*sides.T)
    longer = int(lengths[1] > lengths[0])
    return math.atan2(sides[longer][1], sides[longer][0]), float(lengths[1 - longer])
