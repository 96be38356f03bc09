"""Lanes corrected by one earlier pass, scored on passes of other recordings along the same road."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import numpy as np

from foretwin.contracts.arrays import Array
from foretwin.contracts.frames import LocalFrame, geo_from_local
from foretwin.contracts.tracks import DrivenTrack
from tests.world_gen.truth.generators import by_foretwin
from tests.world_gen.truth.hd_map import HdMap, Track
from tests.world_gen.truth.lane_model import Nearby
from tests.world_gen.truth.tracks import beside, driven

_SAME_ROAD_M = 5.0
_SAME_SHARE = 0.8
_EARLIER = 24
"""So many tracks, evenly among all, are taken as the one that was driven earlier."""


class Again(NamedTuple):
    """How far passes lie from lanes, each half metre, without and with one earlier pass."""

    before_m: Array
    after_m: Array
    turning: np.ndarray


def as_track(frame: LocalFrame, key: str, xy_m: Array) -> DrivenTrack:
    """Return places (N, 2) as the store of tracks holds them."""
    geo = geo_from_local(frame, xy_m)
    return DrivenTrack(
        id=key, name=key, added_utc="", stamp_ns=np.arange(len(xy_m)) * 100_000_000,
        lat_deg=geo[:, 0], lon_deg=geo[:, 1], speed_mps=np.zeros(len(xy_m)),
    )  # fmt: skip


def driven_again(hd: HdMap, map_file: Path) -> Again:
    """Score every pair of an earlier track and one of another recording along the same road."""
    base = by_foretwin(map_file, hd.frame)
    parts: list[Again] = []
    step = max(len(hd.tracks) // _EARLIER, 1)
    for earlier in hd.tracks[::step]:
        later = list(_along(earlier, hd.tracks))
        if not later:
            continue
        known = as_track(hd.frame, earlier.id, earlier.xy_m)
        after = by_foretwin(map_file, hd.frame, tracks=(known,))
        one, two = beside(base, later), beside(after, later)
        parts.append(Again(one.away_m, two.away_m, one.turning))
    joined = (np.concatenate(column) for column in zip(*parts, strict=True))
    return Again(*joined)


def _along(earlier: Track, tracks: tuple[Track, ...]) -> Iterator[Array]:
    nearby = Nearby([earlier.xy_m])
    for track in tracks:
        if track.recording != earlier.recording:
            line = driven(track.xy_m)
            away = np.abs(nearby.lateral(line.xy_m, line.along)[0])
            if (away < _SAME_ROAD_M).mean() > _SAME_SHARE:
                yield track.xy_m
