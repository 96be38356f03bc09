"""In which country a place is, beside borders too, and on which side is driven there."""

from __future__ import annotations

import msgspec
import numpy as np
import pytest
import shapely

from foretwin.world_gen.countries.outlines import NOWHERE, OUTLINES, place_at, places_of


@pytest.mark.parametrize(
    ("place", "lat", "lon", "code"),
    [
        ("Basel", 47.560, 7.590, "CH"),
        ("Weil am Rhein", 47.593, 7.620, "DE"),
        ("Strasbourg", 48.580, 7.750, "FR"),
        ("Kehl", 48.573, 7.815, "DE"),
        ("Konstanz", 47.660, 9.175, "DE"),
        ("Kreuzlingen", 47.645, 9.180, "CH"),
        ("Monaco", 43.738, 7.425, "MC"),
        ("Beausoleil, 700 m north of it", 43.7445, 7.4245, "FR"),
        ("Vaduz", 47.140, 9.520, "LI"),
        ("Buchs", 47.167, 9.478, "CH"),
        ("Feldkirch", 47.237, 9.598, "AT"),
        ("Niagara Falls, Ontario", 43.090, -79.080, "CA"),
        ("Niagara Falls, New York", 43.094, -79.040, "US"),
        ("Ciudad Juárez", 31.735, -106.483, "MX"),
        ("El Paso", 31.760, -106.480, "US"),
        ("in the Øresund, on its bridge", 55.570, 12.850, "SE"),
        ("Hong Kong", 22.300, 114.200, "HK"),
        ("Leeds", 53.800, -1.550, "GB"),
        ("Suva, across the antimeridian", -18.140, 178.440, "FJ"),
    ],
)
def test_a_place_is_in_its_country(place: str, lat: float, lon: float, code: str) -> None:
    assert place_at(lat, lon).code == code, place


def test_outlines_are_whole() -> None:
    features = msgspec.json.decode(OUTLINES.read_bytes())["features"]
    shapes = [shapely.from_geojson(msgspec.json.encode(f["geometry"])) for f in features]
    assert all(shapely.is_valid(shapes))
    assert all(f["bbox"] == list(shape.bounds) for f, shape in zip(features, shapes, strict=True))


def test_places_of_one_map_may_lie_in_several_countries_or_in_none() -> None:
    places = np.array([[47.593, 7.62], [47.56, 7.59], [47.65, 7.3]])
    assert [place.code for place in places_of(places)] == ["DE", "CH", "FR"]
    assert place_at(45.0, -40.0) == NOWHERE
    assert [place_at(52.0, 10.0).code, place_at(53.0, -8.0).code] == ["DE", "IE"], "whole degrees"
    assert places_of(np.zeros((0, 2))) == ()


@pytest.mark.parametrize(
    ("place", "lat", "lon", "side"),
    [
        ("Manchester", 53.45, -2.3, "left"),
        ("Dublin", 53.35, -6.26, "left"),
        ("Dover", 51.13, 1.31, "left"),
        ("Calais", 50.95, 1.86, "right"),
        ("Jersey", 49.2, -2.1, "left"),
        ("Cherbourg", 49.63, -1.6, "right"),
        ("Tokyo", 35.7, 139.7, "left"),
        ("Naha", 26.2, 127.7, "left"),
        ("Seoul", 37.6, 127.0, "right"),
        ("Busan", 35.1, 129.0, "right"),
        ("Sydney", -33.9, 151.2, "left"),
        ("Auckland", -36.8, 174.8, "left"),
        ("Delhi", 28.6, 77.2, "left"),
        ("Karachi", 24.9, 67.0, "left"),
        ("Kabul", 34.5, 69.2, "right"),
        ("Dhaka", 23.8, 90.4, "left"),
        ("Kathmandu", 27.7, 85.3, "left"),
        ("Colombo", 6.9, 79.9, "left"),
        ("Bangkok", 13.75, 100.5, "left"),
        ("Phnom Penh", 11.6, 104.9, "right"),
        ("Yangon", 16.8, 96.2, "right"),
        ("Singapore", 1.35, 103.8, "left"),
        ("Jakarta", -6.2, 106.8, "left"),
        ("Manila", 14.6, 121.0, "right"),
        ("Hong Kong", 22.3, 114.2, "left"),
        ("Shenzhen", 22.6, 114.1, "right"),
        ("Johannesburg", -26.2, 28.0, "left"),
        ("Windhoek", -22.6, 17.1, "left"),
        ("Nairobi", -1.3, 36.8, "left"),
        ("Kampala", 0.3, 32.6, "left"),
        ("Addis Ababa", 9.0, 38.7, "right"),
        ("Kinshasa", -4.3, 15.3, "right"),
        ("Luanda", -8.8, 13.2, "right"),
        ("Antananarivo", -18.9, 47.5, "right"),
        ("Kingston", 18.0, -76.8, "left"),
        ("Havana", 23.1, -82.4, "right"),
        ("Port-au-Prince", 18.5, -72.3, "right"),
        ("Valletta", 35.9, 14.5, "left"),
        ("Nicosia", 35.2, 33.4, "left"),
        ("Berlin", 52.5, 13.4, "right"),
        ("Paris", 48.9, 2.35, "right"),
        ("San Francisco", 37.8, -122.4, "right"),
        ("Toronto", 43.7, -79.4, "right"),
        ("Oslo", 59.9, 10.7, "right"),
        ("Brest", 48.4, -4.5, "right"),
    ],
)
def test_side_of_the_road(place: str, lat: float, lon: float, side: str) -> None:
    assert place_at(lat, lon).driving_side == side, place
