"""Scores of a generator's lanes against an HD map: offset, width, stop line, paths, movements."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import shapely

from foretwin.contracts.arrays import Array
from foretwin.geometry.polyline import densified, length, tangents, unit
from tests.world_gen.truth.carriageways import carriageways
from tests.world_gen.truth.hd_map import HdMap
from tests.world_gen.truth.junction_ways import movements
from tests.world_gen.truth.lane_model import LaneModel, Nearby

_SAMPLE_M = 2.0
_LOOK_M = 24.0
"""Lanes of the model are sought so far before a junction of the truth, and behind it."""
_SAME_LANE_M = 2.0
_LONGEST_WAY_M = 90.0


class MapScore(NamedTuple):
    """Errors in metres, one for each place looked at, NaN where the model has nothing there."""

    offset_m: Array
    width_m: Array
    """The model's less the truth's."""
    stop_line_m: Array
    """How far the model's approach lanes end beyond the truth's, toward the junction."""
    path_m: Array
    movements: int
    """How many (approach lane, exit road) the HD map has."""
    found: int
    """Of these, how many the model has too."""
    extra: int
    """How many it has beside them between the same roads."""


def map_score(hd: HdMap, model: LaneModel) -> MapScore:
    """Return how a model fits the HD map that its map was reduced from."""
    seen = _Seen(model)
    lanes = {k: v for k, v in hd.lanes.items() if not v.inside and v.kind != "bicycle"}
    offset, width = [], []
    for lane in lanes.values():
        away, which = seen.along(_sampled(lane.centerline))
        offset.append(np.abs(away))
        width += [model.lanes[key].width_m - lane.width_m for key in which if key]
    road_of = {key: i for i, road in enumerate(carriageways(hd)) for key in road.lane_ids}
    found = [m for m in movements(hd) if m.from_lane in road_of and m.to_lane in road_of]
    entries = {m.from_lane: seen.entry(hd.lanes[m.from_lane].centerline) for m in found}
    exits: dict[int, set[str]] = {}
    for m in found:
        begin = seen.beside(_first(hd.lanes[m.to_lane].centerline))
        exits.setdefault(road_of[m.to_lane], set()).update(begin)
    ways = {key: _ways(model, entry[0]) for key, entry in entries.items() if entry is not None}
    wanted = {(m.from_lane, road_of[m.to_lane]) for m in found}
    have = {
        (key, road)
        for key, paths in ways.items()
        for road, mine in exits.items()
        if mine & paths.keys()
    }
    # Only what the truth's own junctions offer counts as too much: not a way around the block.
    near = _exits_of_junctions(hd, road_of)
    extra = {(key, road) for key, road in have - wanted if road in near[key]}
    path = [np.empty(0)]
    for m in found:
        line = _sampled(np.concatenate([hd.lanes[k].centerline for k in m.inside]))
        path.append(_path_error(line, ways.get(m.from_lane, {}), exits[road_of[m.to_lane]]))
    return MapScore(
        offset_m=np.concatenate(offset),
        width_m=np.array(width),
        stop_line_m=np.array([np.nan if e is None else e[1] for e in entries.values()]),
        path_m=np.concatenate(path),
        movements=len(wanted),
        found=len(wanted & have),
        extra=len(extra),
    )


class _Seen:
    """A model's lanes as they are found from the truth's."""

    def __init__(self, model: LaneModel) -> None:
        self._model = model
        self._keys = list(model.lanes)
        self._nearby = Nearby([model.lanes[key].line for key in self._keys])

    def along(self, line: Array) -> tuple[Array, list[str]]:
        """Return how far the nearest lane lies beside each point, and which it is ("" for none)."""
        away, which = self._nearby.lateral(line, tangents(line))
        return away, [self._keys[i] if i >= 0 else "" for i in which]

    def beside(self, line: Array) -> list[str]:
        """Return the lanes that a line runs along, by how much of it."""
        away, which = self.along(line)
        near = [key for key, d in zip(which, np.abs(away), strict=True) if d < _SAME_LANE_M]
        return sorted(set(near), key=lambda key: -near.count(key))

    def entry(self, line: Array) -> tuple[str, float] | None:
        """Return the lane that stands for an approach lane, and how far beyond it it ends."""
        ahead = unit(line[-1] - line[-3])
        ends = {
            key: float((self._model.lanes[key].line[-1] - line[-1]) @ ahead)
            for key in self.beside(_sampled(line)[-round(_LOOK_M / _SAMPLE_M) :])
        }
        return min(ends.items(), key=lambda item: abs(item[1])) if ends else None


def _first(line: Array) -> Array:
    return _sampled(line)[: round(_LOOK_M / _SAMPLE_M)]


def _ways(model: LaneModel, start: str) -> dict[str, list[Array]]:
    """Return the ways on from a lane's end, as lines, by the lane that they lead to."""
    after: dict[str, list[tuple[str, Array]]] = {}
    for c in model.connections:
        after.setdefault(c.from_lane, []).append((c.to_lane, c.line))
    for a, b in model.joins:
        after.setdefault(a, []).append((b, model.lanes[b].line[:1]))
    found: dict[str, list[Array]] = {}
    open_ = [(start, model.lanes[start].line[-1:], 0.0)]
    while open_:
        key, line, driven_m = open_.pop()
        for to, link in after.get(key, ()):
            if any(to == begun for begun, _, _ in open_) or len(found.get(to, ())) > 3:
                continue
            whole = np.concatenate([line, link])
            found.setdefault(to, []).append(whole)
            own = model.lanes[to].line
            on_m = driven_m + length(np.concatenate([line[-1:], link])) + length(own)
            if on_m < _LONGEST_WAY_M:
                open_.append((to, np.concatenate([whole, own]), on_m))
    return found


def _exits_of_junctions(hd: HdMap, road_of: dict[str, int]) -> dict[str, set[int]]:
    """Return for each approach lane the roads that any lane beside it leads to."""
    of_road: dict[int, set[int]] = {}
    found = [m for m in movements(hd) if m.from_lane in road_of and m.to_lane in road_of]
    for m in found:
        of_road.setdefault(road_of[m.from_lane], set()).add(road_of[m.to_lane])
    return {m.from_lane: of_road[road_of[m.from_lane]] for m in found}


def _path_error(line: Array, ways: dict[str, list[Array]], exits: set[str]) -> Array:
    """Return how far points of the truth's path lie from the model's nearest way to that road."""
    mine = [way for key in exits & ways.keys() for way in ways[key] if len(way) > 1]
    if not mine:
        return np.full(len(line), np.nan)
    points = shapely.points(line)
    each = [shapely.distance(points, shapely.LineString(way)) for way in mine]
    return np.asarray(min(each, key=lambda away: float(np.mean(away))))


def _sampled(line: Array) -> Array:
    return densified(line, spacing_m=_SAMPLE_M)
