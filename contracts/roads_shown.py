"""The whole map and the route as they are drawn: what a viewer shows around the Worlds."""

from __future__ import annotations

import msgspec

from foretwin.contracts.arrays import Array


class StreetName(msgspec.Struct, frozen=True, kw_only=True):
    """A street's name, and where it is written."""

    name: str
    x_m: float
    y_m: float


class RoadsShown(msgspec.Struct, frozen=True, kw_only=True):
    """Centre lines of the map's roads for cars, and the way that is to be driven, in the drive's
    frame.

    `xy_m` (N, 2) holds the roads on end, of `counts` (K,) vertices each; `routes` are lines (M, 2),
    none where the route is predicted.
    """

    xy_m: Array
    counts: Array
    routes: tuple[Array, ...]
    names: tuple[StreetName, ...]
