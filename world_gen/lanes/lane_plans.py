"""What a cross-section is made of: lanes with their kind, width, turns and place."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from functools import cached_property
from typing import NamedTuple

import msgspec

from foretwin.contracts.provenance import Provenance, Quantity
from foretwin.contracts.world import LaneChange, LaneKind, Turn

_NUMBER = re.compile(r"^\s*(\d+(?:[.,]\d+)?)\s*(m|ft|')?\s*$")


class LanePlan(msgspec.Struct, frozen=True, kw_only=True):
    """One lane of a cross-section.

    `number` counts from the left as its driver sees it, as `lanes` and `placement` do: lanes for
    bicycles, parking and turns from both directions are `counted` not and have numbers below
    0, each its own. `label` tells it from all
    others of the road. `left_m` is how far its centre lies to the left of the way, looking along
    the way's nodes; `reverse` lanes run against the nodes.
    """

    label: str
    reverse: bool
    number: int
    kind: LaneKind
    width_m: Quantity
    left_m: float = 0.0
    turns: tuple[Turn, ...] = ()
    turns_source: Provenance = "inferred"
    arrows: tuple[str, ...] = ()
    """The tagged words that `turns` is read from, which know slight and sharp turns."""
    direction_source: Provenance = "inferred"
    change: LaneChange = "both"
    change_source: Provenance = "default"
    counted: bool = True
    speed_limit_mps: Quantity | None = None
    """Of this lane alone; None where the road's holds."""


class CrossSection(msgspec.Struct, frozen=True, kw_only=True, dict=True):
    """Lanes from left to right along the way's nodes, and the carriageway's edges.

    `left_m` and `right_m` are the distances of the edges to the left of the way, so `right_m` is
    usually negative.
    """

    lanes: tuple[LanePlan, ...]
    left_m: float
    right_m: float
    notes: tuple[str, ...]

    @property
    def width_m(self) -> float:
        """Width of the carriageway in metres."""
        return self.left_m - self.right_m

    @property
    def half_width_m(self) -> float:
        """The wider of both sides, measured from the way."""
        return max(abs(self.left_m), abs(self.right_m))

    def along(self, *, reverse: bool) -> LanesAlong:
        """Return the lanes of one direction: along the nodes, or with `reverse` against them."""
        return self._by_direction[reverse]

    @cached_property
    def _by_direction(self) -> tuple[LanesAlong, LanesAlong]:
        """Along the nodes and against them: thousands of roads share the few sections of a town."""
        return _along(self.lanes, False), _along(self.lanes, True)


class LanesAlong(NamedTuple):
    """The lanes of one direction of a road."""

    reach_m: tuple[float, float]
    """How far the middles of the outermost counted lanes lie from the way, to the left and to the
    right as their driver sees it; NaN where there are none."""
    driven: tuple[LanePlan, ...]
    """Counted lanes, from the left as their driver sees them."""
    abreast: tuple[LanePlan, ...]
    """All lanes that cars or buses drive, from their drivers' left."""
    cycled: tuple[LanePlan, ...]
    """Bicycle lanes, from left to right along the way."""
    turning: tuple[LanePlan, ...]
    """Lanes in the middle from which both directions turn."""


def _along(lanes: tuple[LanePlan, ...], reverse: bool) -> LanesAlong:
    mine = [lane for lane in lanes if lane.reverse == reverse]
    counted = [lane for lane in mine if lane.counted]
    lefts = [-lane.left_m if reverse else lane.left_m for lane in counted]
    abreast = [lane for lane in mine if lane.kind in ("driving", "bus")]
    return LanesAlong(
        reach_m=(max(lefts), -min(lefts)) if lefts else (math.nan, math.nan),
        driven=tuple(sorted(counted, key=lambda lane: lane.number)),
        abreast=tuple(sorted(abreast, key=lambda lane: lane.left_m, reverse=not reverse)),
        cycled=tuple(lane for lane in mine if lane.kind == "bicycle"),
        turning=tuple(lane for lane in mine if not lane.counted and lane.kind == "driving"),
    )


def metres(text: str | None) -> float | None:
    """Return a length tag such as `3.5`, `3,5`, `3 m` or `12 ft` in metres, else None."""
    found = _NUMBER.match(text or "")
    if not found:
        return None
    value = float(found[1].replace(",", "."))
    return value * 0.3048 if found[2] in ("ft", "'") else value


def tagged_width(text: str | None, least_m: float, most_m: float) -> Quantity | None:
    """Return a tagged width in metres; None where there is none that a lane can have."""
    value = metres(text)
    return Quantity(value, "tagged") if value is not None and least_m <= value <= most_m else None


def of_side(tags: Mapping[str, str], key: str, side: str, suffix: str = "") -> str | None:
    """Return a tag of the left or right side of a road: of it, of both sides, or of the road."""
    for name in (f"{key}:{side}{suffix}", f"{key}:both{suffix}", f"{key}{suffix}"):
        if name in tags:
            return tags[name]
    return None
