"""Places in a plane, and those that no plane holds."""

from __future__ import annotations

import numpy as np
import pytest

from foretwin.contracts.frames import GeoPoint
from foretwin.telemetry.estimator.local_place import LocalPlace

BERLIN = GeoPoint(52.5, 13.4)


def test_a_place_in_the_plane_comes_back_from_it() -> None:
    place = LocalPlace.around(BERLIN)
    assert place.xy_m(BERLIN) == pytest.approx([0.0, 0.0], abs=1e-6)
    back = place.position(place.xy_m(GeoPoint(52.51, 13.42)))
    assert (back.lat_deg, back.lon_deg) == pytest.approx((52.51, 13.42), abs=1e-9)


@pytest.mark.parametrize("where", [GeoPoint(-52.5, -166.6), GeoPoint(0.0, 103.4)])
def test_the_other_side_of_the_earth_is_far_away_and_no_infinity(where: GeoPoint) -> None:
    place = LocalPlace.around(BERLIN)
    away = place.xy_m(where)
    assert np.isfinite(away).all()
    assert not place.reaches(away)
