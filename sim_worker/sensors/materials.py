"""How what is in a World looks to a lidar's light, to a radar's waves and to a camera."""

from __future__ import annotations

import math

import numpy as np

from foretwin.contracts.arrays import Array
from foretwin.contracts.drive import RoadUserKind

_CONCRETE, _ASPHALT, _TREE, _WOOD, _HEDGE, _METAL = 0.24, 0.17, 0.60, 0.25, 0.30, 0.40
"""Shares at 900 nm as RIEGL's data sheets (such as of the LD90-3) list them, from memory and not
compared with one: smooth concrete, asphalt with pebbles, deciduous trees, clean rough wood,
conifers; painted metal is chosen."""
REFLECTIVITY: dict[str, float] = {
    "ground": _ASPHALT, "building": _CONCRETE, "roofs": _CONCRETE, "tree": _TREE, "lamp": _METAL,
    "pole": _METAL, "bollard": _METAL, "block": _CONCRETE, "wall": _CONCRETE, "fence": _WOOD,
    "hedge": _HEDGE, "guard_rail": _METAL, "shelter": _METAL,
}  # fmt: skip
"""By how a geom of a World is called."""
OTHER_REFLECTIVITY = _CONCRETE
"""Of islands and what else there is."""
OF_ROAD_USERS: dict[RoadUserKind, float] = {"pedestrian": 0.3, "bicycle": 0.3}
"""Of clothes: chosen; other road users are painted metal."""
_ROUGHNESS_RAD = math.radians(30.0)
"""Of all surfaces, chosen. With it pavement is seen to a quarter of the range of cars; a smooth one
(0) would be seen to an eighth, and data sheets say two fifths (HDL-64E: 50 against 120 m)."""

RCS_DBSM: dict[RoadUserKind, float] = {
    "pedestrian": -5.0, "bicycle": 0.0, "motorcycle": 5.0, "car": 10.0, "unknown": 10.0,
    "van": 13.0, "lorry": 20.0, "bus": 20.0, "tram": 20.0,
}  # fmt: skip
"""Mean radar cross sections at 77 GHz, over all sides: chosen within what is published (people some
-10 to 0, cars 5 to 20, lorries above), from memory. 3GPP TR 22.837 takes a car for 10."""

COLOURS: dict[RoadUserKind, tuple[float, float, float]] = {
    "pedestrian": (0.75, 0.45, 0.15), "bicycle": (0.85, 0.65, 0.10),
    "motorcycle": (0.55, 0.20, 0.55), "car": (0.15, 0.30, 0.65), "unknown": (0.5, 0.5, 0.5),
    "van": (0.90, 0.90, 0.88), "lorry": (0.25, 0.50, 0.30), "bus": (0.85, 0.75, 0.20),
    "tram": (0.70, 0.15, 0.15),
}  # fmt: skip
"""Of road users in pictures: chosen, one for each kind."""


def rcs_m2_of(kind: RoadUserKind) -> float:
    """Return the mean radar cross section of a road user."""
    return float(10.0 ** (RCS_DBSM[kind] / 10.0))


def reflectivity_of(kind: RoadUserKind) -> float:
    """Return the share of light that a road user gives back where it is struck squarely."""
    return OF_ROAD_USERS.get(kind, _METAL)


def back_scatter(cos_incidence: Array) -> Array:
    """Return (…) how bright surfaces look to who lights them, 1 where they are struck squarely.

    Oren and Nayar (1994), Generalization of Lambert's Reflectance Model, equation 30 with the
    viewer at the light: A cos + B sin², over its value at 0.
    """
    squared = _ROUGHNESS_RAD**2
    a, b = 1.0 - 0.5 * squared / (squared + 0.33), 0.45 * squared / (squared + 0.09)
    return np.asarray(cos_incidence + b / a * (1.0 - cos_incidence**2))
