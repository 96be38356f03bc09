"""Positions in other units and grids: told by the speed beside them, by the coast, or asked for."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pyproj
import pytest

from foretwin.contracts.arrays import Array
from foretwin.contracts.drive import GnssFix
from foretwin.contracts.frames import GeoPoint, LocalFrame, local_from_geo
from foretwin.telemetry.logs import open_log
from foretwin.telemetry.logs.declare import propose
from foretwin.telemetry.logs.log import LogError
from foretwin.telemetry.logs.write_declaration import declaration_toml
from tests.telemetry.logs.declare.test_propose import country, drawn_drive

COVERS = (
    "foretwin.telemetry.logs.declare.choice",
    "foretwin.telemetry.logs.units",
)


def drive_columns() -> dict[str, Array]:
    drive = drawn_drive(end_s=75.0)
    gnss, speed = drive["gnss"], drive["speed"]
    return {
        "t": gnss.stamps_ns / 1e9,
        "lat": gnss.columns["latitude"],
        "lon": gnss.columns["longitude"],
        "v": 3.6 * np.interp(gnss.stamps_ns, speed.stamps_ns, speed.columns["forward"]),
    }


def written(folder: Path, columns: dict[str, Array], *, decimals: int = 9) -> Path:
    path = folder / "drive.csv"
    rows = zip(*columns.values(), strict=True)
    lines = (",".join(f"{value:.{decimals}f}" for value in row) for row in rows)
    path.write_text("\n".join([",".join(columns), *lines, ""]))
    return path


def read_again(path: Path, **answers: str) -> str:
    """Declare a table, hold its positions against the drive's, and return the declaration."""
    found = propose(path, country_of=country, answers=answers)
    assert found.question is None
    assert found.declaration is not None
    text = declaration_toml(found.declaration, said=found.evidence)
    (declared := path.with_name("declared.toml")).write_text(text, encoding="utf-8")
    said = [message for _, message in open_log(path, declaration=declared).samples()]
    fixes = [one.position for one in said if isinstance(one, GnssFix)]
    truth = drive_columns()
    frame = LocalFrame(GeoPoint(float(truth["lat"][0]), float(truth["lon"][0])))
    lat, lon = np.array([(one.lat_deg, one.lon_deg) for one in fixes]).T
    apart = local_from_geo(frame, lat, lon) - local_from_geo(frame, truth["lat"], truth["lon"])
    assert np.hypot(*apart.T).max() < 0.1
    return text


def ddmm(angle: Array) -> Array:
    return np.floor(angle) * 100.0 + angle % 1.0 * 60.0


IN_UNIT: dict[str, Callable[[Array], Array]] = {
    "1e-7 deg": lambda angle: np.round(angle * 1e7),
    "1e-6 deg": lambda angle: np.round(angle * 1e6),
    "mas": lambda angle: np.round(angle * 3.6e6),
    "arcmin": lambda angle: angle * 60.0,
    "ddmm": ddmm,
}


@pytest.mark.parametrize("unit", list(IN_UNIT))
def test_the_speed_beside_positions_tells_their_unit(tmp_path: Path, unit: str) -> None:
    columns = drive_columns()
    for name in ("lat", "lon"):
        columns[name] = IN_UNIT[unit](columns[name])
    text = read_again(written(tmp_path, columns))
    assert f'latitude = {{ column = "lat", unit = "{unit}" }}' in text
    assert 'forward = { column = "v", unit = "km/h" }' in text


def test_whole_parts_of_a_degree_have_no_decimals(tmp_path: Path) -> None:
    columns = drive_columns()
    for name in ("lat", "lon"):
        columns[name] = columns[name] * 1e6 + 0.5
    with pytest.raises(LogError):
        propose(written(tmp_path, columns), country_of=country)


def test_without_a_speed_a_unit_is_asked_for_and_can_be_answered(tmp_path: Path) -> None:
    columns = drive_columns()
    del columns["v"]
    for name in ("lat", "lon"):
        columns[name] = IN_UNIT["1e-6 deg"](columns[name])
    path = written(tmp_path, columns)
    asked = propose(path, country_of=lambda lat, lon: "somewhere").question
    assert asked is not None
    assert asked.key == "position_unit"
    assert "1e-6 deg" in asked.choices
    read_again(path, position_unit="1e-6 deg")
    with pytest.raises(LogError, match="positions cannot be in 'feet'"):
        propose(path, answers={"position_unit": "feet"})


def plane_columns() -> tuple[dict[str, Array], str]:
    columns = drive_columns()
    zero = GeoPoint(float(columns["lat"][0]) - 0.001, float(columns["lon"][0]) - 0.001)
    xy_m = local_from_geo(LocalFrame(zero), columns["lat"], columns["lon"])
    return (
        {"t": columns["t"], "v": columns["v"], "x": xy_m[:, 0], "y": xy_m[:, 1]},
        f"{zero.lat_deg!r},{zero.lon_deg!r}",
    )


@pytest.mark.parametrize(("unit", "per_m"), [("km", 1e-3), ("cm", 100.0), ("mm", 1000.0)])
def test_lengths_in_a_plane_need_not_be_metres(tmp_path: Path, unit: str, per_m: float) -> None:
    columns, zero = plane_columns()
    columns |= {name: columns[name] * per_m for name in ("x", "y")}
    path = written(tmp_path, columns)
    asked = propose(path, country_of=country).question
    assert asked is not None
    assert asked.key == "origin"
    assert f'x = {{ column = "x", unit = "{unit}" }}' in read_again(path, origin=zero)


def test_a_speed_and_a_course_are_no_way_in_a_plane(tmp_path: Path) -> None:
    """They move as a car does, in some unit of length; where it is stands in letters."""
    columns = drive_columns()
    lat, lon = (columns.pop(name) for name in ("lat", "lon"))
    course = np.degrees(np.arctan2(np.gradient(lon), np.gradient(lat)))
    path = written(tmp_path, columns | {"Kurs": course % 360.0})
    with pytest.raises(LogError, match="no columns that move as a car does"):
        propose(path, country_of=country)


@pytest.mark.parametrize(("east", "north"), [("y_e", "x_n"), ("Y (East)", "X (North)"), ("e", "n")])
def test_east_and_north_in_names_count_more_than_x_and_y(
    tmp_path: Path, east: str, north: str
) -> None:
    columns, zero = plane_columns()
    path = written(
        tmp_path, {"t": columns["t"], "v": columns["v"], north: columns["y"], east: columns["x"]}
    )
    assert f'x = {{ column = "{east}", unit = "m" }}' in read_again(path, origin=zero)
    told = propose(path, answers={"origin": zero}).unknown
    assert f"position: that {east} points east and {north} north (odometry's axes do not)" in told


@pytest.mark.parametrize("code", [32632, 31468, 3857, 25833])
@pytest.mark.parametrize("names", [("Rechtswert", "Hochwert"), ("a", "b")])
def test_a_grid_is_asked_for_once_and_tells_order_and_scale(
    tmp_path: Path, code: int, names: tuple[str, str]
) -> None:
    """In EPSG 3857 a metre is 1.5 m long here: km/h would be taken for mph."""
    columns = drive_columns()
    to_grid = pyproj.Transformer.from_crs(4326, code, always_xy=True)
    east, north = to_grid.transform(columns.pop("lon"), columns.pop("lat"))
    path = written(tmp_path, columns | {names[1]: np.asarray(north), names[0]: np.asarray(east)})
    asked = propose(path, country_of=country).question
    assert asked is not None
    assert asked.key == "epsg"
    text = read_again(path, epsg=str(code))
    assert f'easting = {{ column = "{names[0]}", unit = "m" }}' in text
    assert 'forward = { column = "v", unit = "km/h" }' in text


def test_a_grid_that_is_used_elsewhere_is_refused(tmp_path: Path) -> None:
    columns = drive_columns()
    to_grid = pyproj.Transformer.from_crs(4326, 32632, always_xy=True)
    east, north = to_grid.transform(columns.pop("lon"), columns.pop("lat"))
    path = written(tmp_path, columns | {"e": np.asarray(east), "n": np.asarray(north)})
    with pytest.raises(LogError, match="no columns that lie where EPSG 2056 is used"):
        propose(path, answers={"epsg": "2056"})
    with pytest.raises(LogError, match="EPSG 99999"):
        propose(path, answers={"epsg": "99999"})


def test_a_column_that_goes_with_the_way_in_no_unit_is_told(tmp_path: Path) -> None:
    """Revolutions of a motor, or a clock that counts another unit."""
    columns = drive_columns()
    columns["rpm"] = columns.pop("v") * 23.0
    told = propose(written(tmp_path, columns), country_of=country).unknown
    said = next(line for line in told if line.startswith("rpm: "))
    assert "goes with the way per time" in said
    assert "unit of positions or of time is another" in said


def test_decimals_of_a_thousandth_of_a_second_do_not_make_it_another_unit(tmp_path: Path) -> None:
    """Without a speed or a coast, nothing tells it from ten millionths of a degree."""
    truth = drive_columns()
    fine = {name: truth[name] * 3.6e6 for name in ("lat", "lon")}
    assert 'unit = "mas"' in read_again(written(tmp_path, {**truth, **fine}, decimals=4))
    alone = propose(written(tmp_path, {"t": truth["t"], **fine}, decimals=4))
    assert alone.question is not None
    assert alone.question.key == "position_unit"
    assert {"1e-7 deg", "mas"} <= set(alone.question.choices)
