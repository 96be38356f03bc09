"""What a building's tags say: whether it stands in the way at all, and from where up to where.

Heights reach up to the ridge, whatever `roof:shape` says (`roofs.py`): a car meets walls.
Keys as in https://wiki.openstreetmap.org/wiki/Simple_3D_Buildings
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import NamedTuple

from foretwin.contracts.provenance import Quantity

LEVEL_HEIGHT_M = 3.0
DEFAULT_HEIGHT_M = 6.0
MAX_HEIGHT_M = 900.0
MAX_LEVELS = 200
CANOPY_HEIGHT_M = 5.0
"""Of a roof on posts without a height, such as a filling station's."""
CARPORT_HEIGHT_M = 3.0
CANOPY_THICKNESS_M = 0.4
HEADROOM_M = 2.5
"""What begins higher over the road stands in no car's way."""
BRIDGE_CLEARANCE_M = 4.5
"""Under a building that bridges a street and has no min_height."""

_HEIGHT = ("height", "building:height")
_UNDERSIDE = ("min_height", "building:min_height")
_UNDERSIDE_LEVEL = ("building:min_level", "min_level")
_LEVELS_AND_ROOF = ("building:levels", "roof:levels", "roof:height")
HEIGHT_KEYS = frozenset((*_HEIGHT, "est_height", *_UNDERSIDE, *_UNDERSIDE_LEVEL, *_LEVELS_AND_ROOF))
_FEET = re.compile(
    r"^\s*(\d+(?:\.\d+)?)\s*(?:'|ft|feet|foot)\s*(?:(\d+(?:\.\d+)?)\s*(?:\"|''|in))?\s*$"
)
_METRES = re.compile(r"^\s*(\d+(?:[.,]\d+)?)\s*(?:m|metres?|meters?)?\s*$")
_COUNT = re.compile(r"^\s*(\d+(?:[.,]\d+)?)\s*$")
_UNBUILT = frozenset(("no", "proposed", "planned", "demolished", "razed", "destroyed", "removed"))
_CANOPIES = frozenset(("roof", "carport", "canopy"))


class Extent(NamedTuple):
    """A building's height and underside above the road, and what its tags leave unclear."""

    height_m: Quantity
    min_height_m: float
    note: str = ""


def height_in_m(text: str | None) -> float | None:
    """Return a height tag such as `12`, `12.5 m`, `40 ft` or `40'6"` in metres, else None."""
    if not text:
        return None
    if found := _METRES.match(text):
        value = float(found[1].replace(",", "."))
    elif found := _FEET.match(text):
        value = 0.3048 * (float(found[1]) + float(found[2] or 0.0) / 12.0)
    else:
        return None
    return value if 0.0 <= value <= MAX_HEIGHT_M else None


def stands_above_ground(tags: Mapping[str, str]) -> bool:
    """Return whether a building or a part of one is built, and not below the road."""
    value = tags.get("building")
    if value is None or value == "no":
        value = tags.get("building:part")
    if value is None or value in _UNBUILT:
        return False
    if "layer" in tags or "location" in tags or "tunnel" in tags:
        layer = tags.get("layer", "0").strip()
        return not (
            (layer.startswith("-") and layer[1:].strip("0").isdigit())
            or tags.get("location") in ("underground", "indoor")
            or tags.get("tunnel") in ("yes", "culvert")
        )
    return True


def is_part(tags: Mapping[str, str]) -> bool:
    """Return whether tags describe a part of a building rather than its outline."""
    return tags.get("building", "no") == "no"


def building_extent(tags: Mapping[str, str]) -> Extent:
    """Return how high a building stands: `height`, else 3 m a level and the roof, else a default.

    `height` and its estimate reach up to the ridge; `building:levels` count up from the road and
    leave out the roof's, to which come `roof:height` or 3 m for each of `roof:levels`. A roof on
    posts is a slab under its top: nothing below it can be run into.
    """
    canopy = _canopy_height(tags)
    bridge = tags.get("building") == "bridge" or tags.get("bridge", "no") != "no"
    if canopy is None and not bridge and HEIGHT_KEYS.isdisjoint(tags):
        return _PLAIN
    low = _underside(tags)
    height, note = _height(tags, DEFAULT_HEIGHT_M if canopy is None else canopy)
    if low is not None and low >= height.value:
        if height.source == "tagged":
            stated = tags.get("height") or tags.get("building:height")
            return Extent(height, 0.0, f"begins at {low:g} m, above its height {stated}; from 0 m")
        height = Quantity(low + LEVEL_HEIGHT_M, height.source)
    if low is None and canopy is not None:
        roof = height_in_m(tags.get("roof:height")) or CANOPY_THICKNESS_M
        low = max(0.0, height.value - min(roof, height.value / 2))
    elif low is None and bridge:
        low = BRIDGE_CLEARANCE_M
        if height.value <= low:
            height = Quantity(low + LEVEL_HEIGHT_M, "default")
    return Extent(height, low or 0.0, note)


_PLAIN = Extent(Quantity(DEFAULT_HEIGHT_M, "default"), 0.0)


def _height(tags: Mapping[str, str], default_m: float) -> tuple[Quantity, str]:
    given = [key for key in _HEIGHT if key in tags]
    for key in given:
        if value := height_in_m(tags[key]):
            return Quantity(value, "tagged"), ""
    note = f"{given[0]}={tags[given[0]]} is not understood" if given else ""
    if value := height_in_m(tags.get("est_height")):
        return Quantity(value, "inferred"), note
    levels = count_of(tags.get("building:levels"))
    if levels is None:
        if "building:levels" in tags and not note:
            note = f"building:levels={tags['building:levels']} is not understood"
        return Quantity(default_m, "default"), note
    roof = height_in_m(tags.get("roof:height"))
    if roof is None:
        roof = (count_of(tags.get("roof:levels")) or 0.0) * LEVEL_HEIGHT_M
    value = levels * LEVEL_HEIGHT_M + roof
    if value <= 0.0:
        return Quantity(default_m, "default"), note
    return Quantity(value, "inferred"), note


def _underside(tags: Mapping[str, str]) -> float | None:
    for key in _UNDERSIDE:
        if (value := height_in_m(tags.get(key))) is not None:
            return value
    for key in _UNDERSIDE_LEVEL:
        if (level := count_of(tags.get(key))) is not None:
            return level * LEVEL_HEIGHT_M
    return None


def _canopy_height(tags: Mapping[str, str]) -> float | None:
    value = tags.get("building", "no")
    if value == "no":
        value = tags.get("building:part", "no")
    if value in _CANOPIES or tags.get("wall") == "no":
        return CARPORT_HEIGHT_M if value == "carport" else CANOPY_HEIGHT_M
    return None


def count_of(text: str | None) -> float | None:
    """Return a number such as of levels, None where it is none or beyond belief."""
    found = _COUNT.match(text) if text else None
    if found is None:
        return None
    value = float(found[1].replace(",", "."))
    return value if value <= MAX_LEVELS else None
