"""HD maps as the truth harness reads them: lanes in metres, and tracks of vehicles."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from foretwin.contracts.arrays import Array
from foretwin.contracts.frames import LocalFrame
from foretwin.geometry.polyline import arc_lengths, cross, points_at, tangents

_POINTS = 24


@dataclass(frozen=True, kw_only=True)
class HdLane:
    """A piece of a lane with its painted edges (N, 2) in driving direction.

    `inside` tells that it leads through a junction; `kind` is "driving", "bus" or "bicycle".
    """

    id: str
    left: Array
    right: Array
    kind: str
    inside: bool
    successors: tuple[str, ...]

    @property
    def centerline(self) -> Array:
        """The middle between both edges, (24, 2)."""
        return (resampled(self.left, _POINTS) + resampled(self.right, _POINTS)) / 2.0

    @property
    def width_m(self) -> float:
        """The median distance between both edges, across the lane."""
        across = resampled(self.left, _POINTS) - resampled(self.right, _POINTS)
        return float(np.median(np.abs(cross(tangents(self.centerline), across))))


@dataclass(frozen=True, kw_only=True)
class Track:
    """Where one vehicle drove: (N, 2) metres in the map's frame; `recording` groups tracks."""

    id: str
    recording: str
    xy_m: Array


@dataclass(frozen=True, kw_only=True)
class HdMap:
    """Lanes by id in a local frame, crossings on foot as lines (2, 2), and tracks on the lanes."""

    name: str
    frame: LocalFrame
    lanes: Mapping[str, HdLane]
    crossings: tuple[Array, ...]
    signals: bool
    tracks: tuple[Track, ...]


def resampled(line: Array, count: int) -> Array:
    """Return `count` points at even distances along a line (N, 2)."""
    return points_at(line, np.linspace(0.0, arc_lengths(line)[-1], count))
