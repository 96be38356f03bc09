import gzip
import zipfile
from pathlib import Path

import numpy as np
import pytest
from PIL import Image, TiffImagePlugin

from foretwin.contracts.errors import UserError
from foretwin.world_gen.elevation.read_dem import dem_digest, read_dem
from foretwin.world_gen.osm.osm_map import LatLonBounds


def tile_bytes() -> bytes:
    """A tile of 3 arc seconds that rises by a metre from row to row southwards, with one void."""
    rows = np.repeat(np.arange(1201)[:, None], 1201, axis=1)
    rows[0, 0] = -32768
    return rows.astype(">i2").tobytes()


def geotiff(path: Path, heights: np.ndarray, *, keys: dict[int, int], point: bool = False) -> Path:
    tags = TiffImagePlugin.ImageFileDirectory_v2()
    tags[33550], tags.tagtype[33550] = (0.5, 0.25, 0.0), 12
    tags[33922], tags.tagtype[33922] = (0.0, 0.0, 0.0, 10.0, 50.0, 0.0), 12
    listed = {1025: 2 if point else 1} | keys
    rows = [v for key, value in listed.items() for v in (key, 0, 1, value)]
    tags[34735], tags.tagtype[34735] = (1, 1, 0, len(listed), *rows), 3
    tags[42113], tags.tagtype[42113] = "-9999", 2
    Image.fromarray(heights.astype(np.float32)).save(path, tiffinfo=tags)
    return path


@pytest.mark.parametrize("packed", ["", ".zip", ".gz"])
def test_a_tile_lies_where_its_name_says(tmp_path: Path, packed: str) -> None:
    file = tmp_path / f"S34W071.hgt{packed}"
    if packed == ".zip":
        with zipfile.ZipFile(file, "w") as archive:
            archive.writestr("S34W071.hgt", tile_bytes())
    else:
        file.write_bytes(gzip.compress(tile_bytes()) if packed else tile_bytes())

    dem = read_dem(file)

    lat, lon = np.array([-33.0, -33.5, -34.0]), np.array([-70.5, -70.5, -70.0])
    assert dem.at(lat, lon) == pytest.approx([0.0, 600.0, 1200.0], abs=1e-6)
    assert np.isnan(dem.at(np.array([-33.0, -35.0]), np.array([-71.0, -70.5]))).all()


def test_a_geotiff_lies_where_its_keys_say(tmp_path: Path) -> None:
    heights = np.array([[1.0, 2.0], [3.0, -9999.0]])
    areas = read_dem(geotiff(tmp_path / "a.tif", heights, keys={2048: 4326}))
    points = read_dem(geotiff(tmp_path / "p.tif", heights, keys={2048: 4326}, point=True))

    # The first pixel's corner lies at 50 N, 10 E, or the pixel is a point there.
    assert areas.at(np.array([49.875]), np.array([10.25])) == pytest.approx([1.0])
    assert points.at(np.array([50.0]), np.array([10.5])) == pytest.approx([2.0])
    assert np.isnan(points.at(np.array([49.75]), np.array([10.5]))).all()


def test_a_projected_geotiff_says_by_which_number(tmp_path: Path) -> None:
    dem = read_dem(geotiff(tmp_path / "u.tif", np.ones((2, 2)), keys={3072: 25832}))

    assert dem.tiles[0].epsg == 25832


@pytest.mark.parametrize(
    ("name", "content", "complaint"),
    [
        ("N43E007.hgt", b"\0" * 100, "100 bytes are no SRTM tile of 2884802 or 25934402"),
        ("heights.hgt", b"\0" * 2 * 1201 * 1201, "says not where it lies, as N43E007.hgt does"),
        ("N43E007.hgt.zip", b"no zip", "cannot be read"),
        ("N43E007.hgt.gz", b"no gzip", "cannot be read"),
        ("a.tif", b"II*\0 no tiff", "cannot be read"),
        ("a.png", b"", "ends in none of .hgt, .hgt.zip, .hgt.gz, .tif, .tiff"),
    ],
)
def test_what_is_no_elevation_is_refused_in_a_line(
    tmp_path: Path, name: str, content: bytes, complaint: str
) -> None:
    (tmp_path / name).write_bytes(content)

    with pytest.raises(UserError, match=complaint) as caught:
        read_dem(tmp_path / name)
    assert "\n" not in str(caught.value)


def test_a_plain_tiff_says_not_where_it_lies(tmp_path: Path) -> None:
    Image.fromarray(np.ones((3, 3), dtype=np.float32)).save(tmp_path / "plain.tif")

    with pytest.raises(UserError, match="says not where it lies"):
        read_dem(tmp_path / "plain.tif")


def test_a_folder_gives_the_tiles_that_reach_the_map(tmp_path: Path) -> None:
    for name in ("N43E007.hgt", "N44E007.hgt"):
        (tmp_path / name).write_bytes(tile_bytes())
    (tmp_path / "SOURCE.txt").write_text("not asked")
    (tmp_path / "N53E007.hgt").write_text("far away: not opened")

    near = read_dem(tmp_path, around=LatLonBounds(43.2, 7.2, 43.3, 7.3))
    assert near.name == "N43E007.hgt"
    with pytest.raises(UserError, match="knows no height between 53, -2"):
        read_dem(tmp_path, around=LatLonBounds(53.0, -2.0, 53.1, -1.9))
    with pytest.raises(UserError, match="no such file"):
        read_dem(tmp_path / "N99E000.hgt")


def test_what_an_elevation_is_needs_no_heights(tmp_path: Path) -> None:
    for name in ("N43E007.hgt", "N44E007.hgt"):
        (tmp_path / name).write_bytes(tile_bytes())

    assert dem_digest(tmp_path) == read_dem(tmp_path).key


@pytest.mark.real_data
def test_srtm_knows_monaco(data_dir: Path) -> None:
    dem = read_dem(data_dir / "dem-monaco" / "N43E007.hgt.zip")

    # The port, and the Tête de Chien above the town, 550 m.
    port, summit = dem.at(np.array([43.7355, 43.7311]), np.array([7.4265, 7.4025]))
    assert 0.0 <= port < 20.0
    assert 450.0 < summit < 560.0
