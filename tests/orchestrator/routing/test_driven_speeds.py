"""Speeds of earlier drives: whose count where."""

from __future__ import annotations

import numpy as np

from foretwin.contracts.frames import GeoPoint, LocalFrame, geo_from_local
from foretwin.contracts.tracks import DrivenTrack, track_id
from foretwin.orchestrator.routing.driven_speeds import DrivenSpeeds

FRAME = LocalFrame(GeoPoint(52.5, 13.4))
LATER_NS = 10**15
PATH = np.column_stack([np.arange(0.0, 100.0), np.zeros(100)])


def track(
    speed_mps: float | np.ndarray,
    *,
    aside_m: float = 0.0,
    back: bool = False,
    from_m: float = -20.0,
    until_m: float = 120.0,
    start_ns: int = 0,
) -> DrivenTrack:
    x = np.arange(from_m, until_m)
    xy = np.column_stack([x[::-1] if back else x, np.full(len(x), aside_m)])
    lat, lon = geo_from_local(FRAME, xy).T
    stamps = start_ns + np.arange(len(x)) * 100_000_000
    return DrivenTrack(
        id=track_id(lat, lon, stamps),
        name="earlier",
        added_utc="2030-01-01T00:00:00Z",
        stamp_ns=stamps,
        lat_deg=lat,
        lon_deg=lon,
        speed_mps=np.broadcast_to(speed_mps, len(x)).astype(np.float64),
    )


def along(*tracks: DrivenTrack, stamp_ns: int = LATER_NS) -> np.ndarray:
    return DrivenSpeeds(tracks, FRAME).along(PATH, stamp_ns=stamp_ns, car_xy_m=PATH[0])


def test_the_road_was_driven_so_fast() -> None:
    np.testing.assert_allclose(along(track(7.0)), 7.0)


def test_where_nobody_drove_nothing_is_known() -> None:
    found = along(track(7.0, until_m=50.0))

    assert np.isfinite(found[:50]).all()
    assert np.isnan(found[56:]).all()
    assert np.isnan(along(track(7.0, aside_m=8.0))).all()


def test_the_other_direction_is_not_this_one() -> None:
    assert np.isnan(along(track(7.0, back=True))).all()
    np.testing.assert_allclose(along(track(7.0), track(12.0, back=True, aside_m=2.0)), 7.0)


def test_of_several_drives_the_median_counts() -> None:
    found = along(track(6.0), track(9.0, aside_m=0.5), track(14.0, aside_m=1.0))

    np.testing.assert_allclose(found[5:-5], 9.0)


def test_waits_are_not_remembered() -> None:
    stopped = np.where(np.arange(140) % 40 < 4, 0.2, 8.0)

    np.testing.assert_allclose(along(track(stopped)), 8.0)


def test_a_replay_does_not_remember_itself() -> None:
    own = track(7.0, start_ns=LATER_NS - 20 * 100_000_000)

    assert np.isnan(along(own)).all()
    np.testing.assert_allclose(along(own, track(5.0)), 5.0)
    assert np.isfinite(along(own, stamp_ns=LATER_NS + 60 * 10**9)).all(), "a day later it counts"


def test_another_car_elsewhere_at_the_same_time_counts() -> None:
    other = track(7.0, start_ns=LATER_NS - 110 * 100_000_000)

    assert np.isfinite(along(other)).all()
