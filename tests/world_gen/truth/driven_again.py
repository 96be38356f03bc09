"""Lanes corrected by one earlier pass, scored on other passes along the same road."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import NamedTuple

import numpy as np
import shapely

from foretwin.contracts.arrays import Array
from foretwin.contracts.frames import LocalFrame, geo_from_local
from foretwin.contracts.tracks import DrivenTrack
from foretwin.geometry.polyline import arc_lengths, points_at
from tests.world_gen.truth.generators import by_foretwin
from tests.world_gen.truth.hd_map import HdMap, Track
from tests.world_gen.truth.lane_model import LaneModel, Nearby
from tests.world_gen.truth.shifted_map import routes, shifted, wandering
from tests.world_gen.truth.tracks import beside, driven

_SAME_ROAD_M = 5.0
_SAME_SHARE = 0.8
_EARLIER = 24
"""So many tracks, evenly among all, are taken as the one that was driven earlier."""
_ROUTES, _ROUTE_M = 16, 600.0
_MOVED_M = 0.1


class Again(NamedTuple):
    """How far passes lie from lanes, each half metre, without and with one earlier pass."""

    before_m: Array
    after_m: Array
    turning: np.ndarray

    def medians_m(self, *, turning: bool) -> tuple[float, float]:
        """Return the medians before and after, where both have a lane near."""
        known = ~np.isnan(self.before_m) & ~np.isnan(self.after_m) & (self.turning == turning)
        return float(np.median(self.before_m[known])), float(np.median(self.after_m[known]))


def as_track(frame: LocalFrame, key: str, xy_m: Array) -> DrivenTrack:
    """Return places (N, 2) as the store of tracks holds them."""
    geo = geo_from_local(frame, xy_m)
    return DrivenTrack(
        id=key, name=key, added_utc="", stamp_ns=np.arange(len(xy_m)) * 100_000_000,
        lat_deg=geo[:, 0], lon_deg=geo[:, 1], speed_mps=np.zeros(len(xy_m)),
    )  # fmt: skip


def driven_again(hd: HdMap, map_file: Path) -> Again:
    """Score every pair of an earlier track and one of another recording along the same road."""
    step = max(len(hd.tracks) // _EARLIER, 1)
    pairs = ((one.xy_m, list(_along(one, hd.tracks))) for one in hd.tracks[::step])
    return _scored(map_file, hd.frame, pairs)


def simulated_again(map_file: Path, frame: LocalFrame, work: Path) -> tuple[Again, Array]:
    """Score simulated passes along a map whose nodes were moved; what is true is the map itself.

    Also returns (L, 2) how far lanes that moved lay from their true place, before and after.
    """
    truth = by_foretwin(map_file, frame)
    moved_map = work / f"shifted-{map_file.name}"
    moved_map.write_text(
        shifted(map_file.read_text(encoding="utf-8"), frame, seed=1), encoding="utf-8"
    )
    lines = routes(truth, count=_ROUTES, length_m=_ROUTE_M, seed=3)
    pairs = ((wandering(r, seed=i), [wandering(r, seed=-1 - i)]) for i, r in enumerate(lines))
    errors: list[tuple[float, float]] = []
    again = _scored(
        moved_map,
        frame,
        pairs,
        lambda base, after: errors.extend(_lane_errors(truth, base, after)),
    )
    return again, np.array(errors)


def _lane_errors(
    truth: LaneModel, base: LaneModel, after: LaneModel
) -> Iterator[tuple[float, float]]:
    for key in truth.lanes.keys() & base.lanes.keys() & after.lanes.keys():
        before, moved = base.lanes[key].line, after.lanes[key].line
        if len(before) != len(moved) or np.abs(before - moved).max() > _MOVED_M:
            true = shapely.LineString(truth.lanes[key].line)
            yield _error_m(before, true), _error_m(moved, true)


def _error_m(line: Array, true: shapely.LineString) -> float:
    # Not at the ends: where a lane ends is another matter.
    at_m = np.linspace(0.15, 0.85, 9) * arc_lengths(line)[-1]
    return float(np.mean(shapely.distance(shapely.points(points_at(line, at_m)), true)))


def _scored(
    map_file: Path,
    frame: LocalFrame,
    pairs: Iterable[tuple[Array, list[Array]]],
    look: Callable[[LaneModel, LaneModel], None] = lambda base, after: None,
) -> Again:
    base = by_foretwin(map_file, frame)
    parts: list[Again] = []
    for i, (earlier, later) in enumerate(pairs):
        if later:
            known = as_track(frame, f"{i:012x}", earlier)
            after = by_foretwin(map_file, frame, tracks=(known,))
            look(base, after)
            one, two = beside(base, later), beside(after, later)
            parts.append(Again(one.away_m, two.away_m, one.turning))
    return Again(*(np.concatenate(column) for column in zip(*parts, strict=True)))


def _along(earlier: Track, tracks: tuple[Track, ...]) -> Iterator[Array]:
    nearby = Nearby([earlier.xy_m])
    for track in tracks:
        if track.recording != earlier.recording:
            line = driven(track.xy_m)
            away = np.abs(nearby.lateral(line.xy_m, line.along)[0])
            if (away < _SAME_ROAD_M).mean() > _SAME_SHARE:
                yield track.xy_m
