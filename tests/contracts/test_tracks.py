"""Tracks: what is refused of them, and the key of a set."""

from __future__ import annotations

import re

import msgspec
import numpy as np
import pytest

from foretwin.contracts.errors import UserError
from foretwin.contracts.tracks import TrackSet
from tests.world_gen.driven.drives import track

STRAIGHT = np.array([[0.0, 0.0], [100.0, 0.0]])


@pytest.mark.parametrize(
    ("field", "value", "words"),
    [
        ("lat_deg", np.array([53.0]), "columns of"),
        ("lat_deg", np.full(100, np.nan), "not finite"),
        ("lat_deg", np.full(100, 90.001), "outside latitude"),
        ("lat_deg", np.full(100, -90.001), "outside latitude"),
        ("lon_deg", np.full(100, 180.001), "longitude ±180"),
        ("lon_deg", np.full(100, -180.001), "longitude ±180"),
        ("lon_deg", np.array([13.0] * 99 + [np.inf]), "not finite"),
        ("speed_mps", np.array([np.nan, *np.zeros(99)]), "not finite"),
        ("position_std_m", -0.1, "deviation of -0.1 m"),
        ("position_std_m", np.inf, "deviation of inf m"),
        ("speed_mps", np.zeros((100, 1)), "columns of"),
    ],
)
def test_columns_that_cannot_be_are_refused(field: str, value: np.ndarray, words: str) -> None:
    one = track(STRAIGHT)
    with pytest.raises(UserError, match=words) as refused:
        msgspec.structs.replace(one, **{field: value}).validate()
    assert str(refused.value).startswith(f"track {one.id}: ")


def test_columns_at_the_ends_of_the_earth_are_taken() -> None:
    for sign in (1.0, -1.0):
        ends = {"lat_deg": np.full(100, 90.0 * sign), "lon_deg": np.full(100, 180.0 * sign)}
        one = msgspec.structs.replace(track(STRAIGHT), position_std_m=0.0, **ends)
        assert one.validate() is one


@pytest.mark.parametrize(("count", "right"), [(1, False), (2, True), (2_000_001, False)])
def test_a_track_is_two_places_to_two_million(count: int, right: bool) -> None:
    columns = {
        name: np.broadcast_to(np.zeros(1, dtype=kind), (count,))
        for name, kind in (
            ("stamp_ns", np.int64), ("lat_deg", float), ("lon_deg", float), ("speed_mps", float),
        )
    }  # fmt: skip
    one = msgspec.structs.replace(track(STRAIGHT), **columns)
    if right:
        assert one.validate() is one
        return
    with pytest.raises(UserError, match=f"{count}, {count}.* points; 2 to 2000000 of each"):
        one.validate()


def test_the_key_of_a_set_depends_on_its_tracks_alone() -> None:
    one, two = track(STRAIGHT), track(STRAIGHT + 5.0)

    assert TrackSet.of((one, two)) == TrackSet.of((two, one))
    assert TrackSet.of((one,)).key != TrackSet.of((two,)).key
    assert len({one.id, two.id, track(STRAIGHT, name="again").id}) == 2
    assert re.fullmatch("[0-9a-f]{12}", one.id)
    assert re.fullmatch("[0-9a-f]{16}", TrackSet.of((one,)).key)
