"""Tracks: what is refused of them, and the key of a set."""

from __future__ import annotations

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
        ("lat_deg", np.full(100, 91.0), "outside latitude"),
        ("speed_mps", np.zeros((100, 1)), "columns of"),
    ],
)
def test_columns_that_cannot_be_are_refused(field: str, value: np.ndarray, words: str) -> None:
    with pytest.raises(UserError, match=words):
        msgspec.structs.replace(track(STRAIGHT), **{field: value}).validate()


def test_the_key_of_a_set_depends_on_its_tracks_alone() -> None:
    one, two = track(STRAIGHT), track(STRAIGHT + 5.0)

    assert TrackSet.of((one, two)) == TrackSet.of((two, one))
    assert TrackSet.of((one,)).key != TrackSet.of((two,)).key
    assert len({one.id, two.id, track(STRAIGHT, name="again").id}) == 2
