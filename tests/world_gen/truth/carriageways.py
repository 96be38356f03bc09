"""Lanes of an HD map gathered into carriageways: what OpenStreetMap draws as one way."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass
from itertools import combinations

import numpy as np
import shapely

from foretwin.contracts.arrays import Array
from foretwin.geometry.polyline import without_repeats
from tests.world_gen.truth.hd_map import HdLane, HdMap, resampled

_POINTS = 24
_SHARED_M = 0.8
"""Lanes whose edges lie nearer than this stand side by side."""
_ON_TOP_M = 1.6
"""Opposed lanes whose middles lie nearer than this share one narrow road."""
_LANE_APART_M = 4.5
_BEND_M = 0.4
"""How far a mapper lets a way stray from the road's middle between two nodes."""


@dataclass(frozen=True, kw_only=True)
class Carriageway:
    """Lanes side by side; `forward` and `backward` are lane ids from their drivers' left.

    `line` (N, 2) is the middle of the carriageway, in the direction of `forward`.
    """

    forward: tuple[str, ...]
    backward: tuple[str, ...]
    line: Array
    narrow: bool
    """Both directions share the one lane that there is."""
    tapers: tuple[tuple[str, ...], tuple[str, ...]] = ((), ())
    """Lanes, forward and backward, that widen or end here beside one that is counted."""

    @property
    def two_way(self) -> bool:
        return bool(self.backward)

    @property
    def lane_ids(self) -> tuple[str, ...]:
        return (*self.forward, *self.backward, *self.tapers[0], *self.tapers[1])


def carriageways(hd: HdMap) -> list[Carriageway]:
    """Return the map's roads outside junctions."""
    lanes = {key: lane for key, lane in hd.lanes.items() if not lane.inside}
    shapes = {key: _Shape.of(lane) for key, lane in lanes.items()}
    group = {key: key for key in lanes}
    tapers: dict[str, str] = {}
    before = {key: {k for k, v in lanes.items() if key in v.successors} for key in lanes}
    for a, b in combinations(lanes, 2):
        parted = bool(before[a] & before[b]) and shapes[a].fans_out(shapes[b], last=True)
        merging = bool(set(lanes[a].successors) & set(lanes[b].successors) & lanes.keys())
        merging = merging and shapes[a].fans_out(shapes[b], last=False)
        if (parted or merging) and a not in tapers:
            tapers[b] = a
        if parted or merging or shapes[a].beside(shapes[b]):
            old, new = group[b], group[a]
            group.update({key: new for key, value in group.items() if value == old})
    members: dict[str, list[str]] = {}
    for key, value in group.items():
        if lanes[key].kind != "bicycle":
            members.setdefault(value, []).append(key)
    return [_carriageway(keys, shapes, tapers.keys()) for keys in members.values()]


@dataclass(frozen=True, kw_only=True)
class _Shape:
    left: Array
    right: Array

    @staticmethod
    def of(lane: HdLane) -> _Shape:
        return _Shape(left=resampled(lane.left, _POINTS), right=resampled(lane.right, _POINTS))

    @property
    def middle(self) -> Array:
        return (self.left + self.right) / 2.0

    @property
    def along(self) -> Array:
        step = self.middle[-1] - self.middle[0]
        return np.asarray(step / max(float(np.hypot(*step)), 1e-9))

    def fans_out(self, other: _Shape, *, last: bool) -> bool:
        """Tell whether lanes that part, or join, stand side by side at their other end."""
        gap = self.middle[-1 if last else 0] - other.middle[-1 if last else 0]
        return bool(np.hypot(*gap) < _LANE_APART_M)

    def beside(self, other: _Shape) -> bool:
        """Tell whether two lanes share an edge, or, driven in opposite directions, the road."""
        same = float(self.along @ other.along)
        if same > 0.8:
            return _near(self.left, other.right) or _near(self.right, other.left)
        if same < -0.8:
            back = _Shape(left=other.left[::-1], right=other.right[::-1])
            return _near(self.left, back.left) or _near(self.middle, back.middle, _ON_TOP_M)
        return False


def _near(a: Array, b: Array, limit_m: float = _SHARED_M) -> bool:
    return bool(np.median(np.hypot(*(a - b).T)) < limit_m)


def _carriageway(
    keys: list[str], shapes: Mapping[str, _Shape], tapers: Collection[str]
) -> Carriageway:
    along = shapes[keys[0]].along
    forward = [key for key in keys if shapes[key].along @ along > 0.0]
    backward = [key for key in keys if key not in forward]
    forward, backward = _from_left(forward, shapes), _from_left(backward, shapes)
    middles = [shapes[f].middle - shapes[b].middle[::-1] for f in forward for b in backward]
    narrow = any(np.median(np.hypot(*gap.T)) < _ON_TOP_M for gap in middles)
    right = shapes[forward[-1]].right
    left = shapes[backward[-1]].right[::-1] if backward else shapes[forward[0]].left
    return Carriageway(
        forward=tuple(key for key in forward if key not in tapers),
        backward=tuple(key for key in backward if key not in tapers),
        line=simplified((left + right) / 2.0),
        narrow=narrow,
        tapers=(
            tuple(key for key in forward if key in tapers),
            tuple(key for key in backward if key in tapers),
        ),
    )


def _from_left(keys: Iterable[str], shapes: Mapping[str, _Shape]) -> list[str]:
    keys = list(keys)
    if not keys:
        return []
    along = shapes[keys[0]].along
    left = np.array([-along[1], along[0]])
    return sorted(keys, key=lambda key: -float(shapes[key].middle[_POINTS // 2] @ left))


def simplified(line: Array) -> Array:
    """Return the line with the few points that a mapper would give it."""
    return without_repeats(
        np.asarray(shapely.get_coordinates(shapely.LineString(line).simplify(_BEND_M)))
    )
