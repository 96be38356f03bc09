import numpy as np
import pytest

from foretwin.contracts.frames import GeoPoint
from foretwin.world_gen.elevation.dem import Dem, DemSet
from tests.world_gen.elevation.hills import raster

HERE = GeoPoint(43.7, 7.4)


def grid(heights: list[list[float]], **changes: object) -> Dem:
    values: dict[str, object] = {
        "name": "g",
        "sha256": "g",
        "heights_m": np.array(heights),
        "first_x": 10.0,
        "first_y": 50.0,
        "step_x": 0.1,
        "step_y": -0.1,
    }
    return Dem(**(values | changes))  # type: ignore[arg-type]


def test_between_samples_heights_are_bilinear() -> None:
    dem = grid([[0.0, 10.0], [20.0, 40.0]])

    lat, lon = np.array([50.0, 49.9, 49.95, 49.95]), np.array([10.0, 10.1, 10.05, 10.0])
    assert dem.at(lat, lon) == pytest.approx([0.0, 40.0, 17.5, 10.0])


def test_an_unknown_sample_leaves_the_others_and_beyond_the_raster_is_unknown() -> None:
    dem = grid([[0.0, np.nan], [20.0, 40.0]])

    lat, lon = np.array([49.95, 50.0, 48.0, 50.0]), np.array([10.05, 10.1, 10.0, 12.0])
    height = dem.at(lat, lon)

    assert height[0] == pytest.approx((0.0 + 20.0 + 40.0) / 3.0)
    assert np.isnan(height[1:]).all()


def test_a_projected_raster_is_asked_in_its_own_metres() -> None:
    # UTM 32 N: its central meridian, 9 degrees east, lies at 500,000 m.
    dem = grid(
        [[1.0, 2.0, 3.0]] * 2,
        first_x=499_990.0,
        first_y=5_500_000.0,
        step_x=10.0,
        step_y=-3e6,
        epsg=32632,
    )

    assert dem.at(np.array([49.0]), np.array([9.0])) == pytest.approx([2.0], abs=1e-4)


def test_coarser_cells_are_trusted_less() -> None:
    flat = lambda x, y: 0.0 * x  # noqa: E731
    coarse, fine = raster(flat, HERE), raster(flat, HERE, arc_s=0.1, reach_deg=0.001)

    assert coarse.cell_m == pytest.approx(92.7, abs=0.1)
    assert (coarse.noise_m, fine.noise_m) == (3.7, 0.3)


def test_of_several_tiles_the_first_that_knows_counts() -> None:
    west, east = grid([[1.0, 1.0]] * 2), grid([[5.0, 5.0]] * 2, first_x=10.1)
    both = DemSet((west, east))

    assert both.at(np.array([49.95, 49.95]), np.array([10.0, 10.2])) == pytest.approx([1.0, 5.0])
    assert both.key == "g g"
    assert both.name == "g, g"
