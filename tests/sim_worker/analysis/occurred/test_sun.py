"""Where the sun stands, against a published position and against what everybody knows."""

from __future__ import annotations

import datetime

import pytest

from foretwin.sim_worker.analysis.occurred.sun import SunPlace, sun_at


def sun(lat_deg: float, lon_deg: float, *when: int) -> SunPlace:
    moment = datetime.datetime(*when, tzinfo=datetime.UTC)  # type: ignore[misc, arg-type]
    return sun_at(int(moment.timestamp()) * 1_000_000_000, lat_deg, lon_deg)


def test_the_sun_is_where_the_solar_position_algorithm_has_it() -> None:
    # The worked example of NREL/TP-560-34302: zenith 50.11162° with refraction, azimuth 194.34024°.
    found = sun(39.742476, -105.1786, 2003, 10, 17, 19, 30, 30)

    assert found.elevation_deg == pytest.approx(90.0 - 50.11162, abs=0.03)
    assert found.azimuth_deg == pytest.approx(194.34024, abs=0.01)


@pytest.mark.parametrize(
    ("hour", "light"), [(12, "day"), (19, "low_sun"), (20, "twilight"), (23, "night")]
)
def test_a_summer_day_in_berlin(hour: int, light: str) -> None:
    assert sun(52.52, 13.4, 2024, 6, 20, hour, 0).light == light


def test_at_noon_it_stands_in_the_south_of_berlin_and_in_the_north_of_sydney() -> None:
    assert sun(52.52, 13.4, 2024, 6, 20, 11, 8).azimuth_deg == pytest.approx(180.0, abs=0.5)
    sydney = sun(-33.87, 151.2, 2024, 6, 20, 1, 57).azimuth_deg
    assert min(sydney, 360.0 - sydney) < 0.5
