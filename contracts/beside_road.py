"""What stands beside roads: buildings with their roofs, and trees, posts, walls and the like."""

from __future__ import annotations

from typing import Literal

import msgspec

from foretwin.contracts.arrays import Array
from foretwin.contracts.provenance import Quantity

RoofForm = Literal[
    "gabled",
    "hipped",
    "half_hipped",
    "pyramidal",
    "skillion",
    "gambrel",
    "mansard",
    "round",
    "dome",
]


class Roof(msgspec.Struct, frozen=True, kw_only=True):
    """The uppermost `height_m` of a building, which ends at its top instead of a flat one.

    `ridge_rad` is the ridge's direction, counter-clockwise from x; a `skillion` falls to the left
    of it.
    """

    form: RoofForm
    height_m: Quantity
    ridge_rad: float


class Building(msgspec.Struct, frozen=True, kw_only=True):
    """A building: footprint and vertical extent above the road, its roof included."""

    id: str
    outline: Array
    holes: tuple[Array, ...]
    height_m: Quantity
    min_height_m: float = 0.0
    roof: Roof | msgspec.UnsetType = msgspec.UNSET
    """Where the map tells no form it is flat, and this is not written."""


ObstacleKind = Literal[
    "tree", "lamp", "pole", "bollard", "block", "wall", "fence", "hedge", "guard_rail", "shelter"
]
SEEN_OVER_BELOW_M = 1.4
"""What is lower hides nobody who stands: a driver's eyes are at 1.08 m (AASHTO Green Book, 2018,
3.2.6), and who walks is higher."""
SEEN_THROUGH: frozenset[ObstacleKind] = frozenset(
    ("tree", "lamp", "pole", "bollard", "fence", "guard_rail")
)


class Obstacle(msgspec.Struct, frozen=True, kw_only=True):
    """What stands beside the road and is no building: outline as of `Area`, from the road up."""

    id: str
    kind: ObstacleKind
    outline: Array
    holes: tuple[Array, ...] = ()
    height_m: Quantity

    @property
    def opaque(self) -> bool:
        """Whether it hides who stands behind it from a driver."""
        return self.kind not in SEEN_THROUGH and self.height_m.value >= SEEN_OVER_BELOW_M
