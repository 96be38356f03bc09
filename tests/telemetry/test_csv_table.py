"""CSV drives: every column declared, every unit named."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import pytest

from foretwin.contracts.frames import GeoPoint, LocalFrame, local_from_geo
from foretwin.telemetry.logs import LogError, open_log
from foretwin.telemetry.logs.log import LAST_LINE_OPEN

COVERS = (
    "foretwin.telemetry.logs.csv_table",
    "foretwin.telemetry.logs.units",
)

DECLARATION = """
reference_point = "antenna on the roof"
body_from_antenna_m = [1.2, 0.0, 1.5]
[time]
column = "t"
unit = "s"
base = "log"
[position]
frame = "wgs84"
latitude = { column = "lat", unit = "deg" }
longitude = { column = "lon", unit = "deg" }
[speed]
forward = { column = "v", unit = "mph" }
[steering]
wheel = { column = "wheel", unit = "deg", negate = true }
"""
ROWS = "t,lat,lon,v,wheel\n0.0,52.5,13.4,10,90\n0.1,52.6,13.5,20,-45\n"


def drive(folder: Path, rows: str = ROWS, declaration: str | None = DECLARATION) -> Path:
    path = folder / "drive.csv"
    path.write_text(rows)
    if declaration is not None:
        (folder / "drive.csv.toml").write_text(declaration)
    return path


def channels(path: Path) -> dict[str, list[Any]]:
    found: dict[str, list[Any]] = {}
    for channel, message in open_log(path).samples():
        found.setdefault(channel, []).append(message)
    return found


def test_units_and_signs_are_converted(tmp_path: Path) -> None:
    found = channels(drive(tmp_path))
    assert [m.stamp_ns for m in found["gnss"]] == [0, 100_000_000]
    assert [m.speed_mps for m in found["speed"]] == pytest.approx([4.4704, 8.9408])
    assert found["steering"][0].steering_wheel_rad == pytest.approx(-math.pi / 2)
    info = open_log(tmp_path / "drive.csv").info
    assert info.body_from_antenna_m == (1.2, 0.0, 1.5)
    assert info.sends == ("gnss", "speed", "steering")


def test_nineteen_digits_of_time_survive(tmp_path: Path) -> None:
    rows = (
        "t,lat,lon,v,wheel\n1772359200123456789,52.5,13.4,1,1\n1772359200123456790,52.5,13.4,1,1\n"
    )
    path = drive(tmp_path, rows, DECLARATION.replace('unit = "s"', 'unit = "ns"'))
    assert [m.stamp_ns % 1000 for m in channels(path)["gnss"]] == [789, 790]


@pytest.mark.parametrize("end", ["", "\n", "\r\n", "\r", "\n\n", "\n \n"])
def test_a_last_line_without_its_end_is_left_out_and_said(tmp_path: Path, end: str) -> None:
    """`23` could have been `23.75`."""
    rows = "t,lat,lon,v,wheel\n0.0,52.5,13.4,10,90\n0.1,52.6,13.5,20,-45\n0.2,52.7,13.6,30,23"
    path = drive(tmp_path)
    path.write_bytes((rows.replace("\n", "\r") if end == "\r" else rows).encode() + end.encode())
    log = open_log(path)
    read = [channel for channel, _ in log.samples()]
    assert read.count("steering") == (3 if end else 2)
    assert log.skipped == ({} if end else {LAST_LINE_OPEN: 1})
    assert log.info.end_stamp_ns == (200_000_000 if end else 100_000_000)


def test_a_table_without_names_is_cut_alike(tmp_path: Path) -> None:
    named = DECLARATION
    for number, name in enumerate(("t", "lat", "lon", "v", "wheel"), start=1):
        named = named.replace(f'column = "{name}"', f'column = "c{number}"')
    rows = ROWS.partition("\n")[2] + "0.2,52.7,13.6,30,23"
    log = open_log(drive(tmp_path, rows, "header = false\n" + named))
    assert len(list(log.samples())) == 6


def test_empty_cells_hold_no_sample_and_bad_ones_are_counted(tmp_path: Path) -> None:
    rows = (
        "t,lat,lon,v,wheel\n0.0,52.5,13.4,10,1\n0.1,,,11,1\n0.2,52.5,,12,1\n0.3,52.5,13.4,fast,1\n"
        "soon,52.5,13.4,13,1\n0.5,52.5\n0.6,nan,13.4,14,1\n"
    )
    log = open_log(drive(tmp_path, rows))
    stamps = [(channel, message.stamp_ns // 10**8) for channel, message in log.samples()]  # type: ignore[attr-defined]
    assert [at for channel, at in stamps if channel == "gnss"] == [0, 3]
    assert [at for channel, at in stamps if channel == "speed"] == [0, 1, 2, 6]
    assert log.skipped == {"unreadable row": 4, "position not finite": 1}


@pytest.mark.parametrize(
    ("old", "new", "told"),
    [
        (', unit = "mph"', "", r"column 'v': no unit; one of m/s, km/h, mph, kn"),
        ('"mph"', '"knots"', r"column 'v': unknown unit 'knots'; one of m/s"),
        ('unit = "s"', "", r"column 't': no unit; one of s, ms, us, ns, iso8601"),
        ('column = "v"', 'column = "speed"', r"drive\.csv: line 1: no column 'speed'"),
        ('frame = "wgs84"', 'frame = "utm"', r"position.frame 'utm': one of ecef"),
        ('frame = "wgs84"', 'frame = "ecef"', r"in frame 'ecef' needs exactly x, y, z"),
        ('frame = "wgs84"', 'frame = "wgs84"\nepsg = 32633', r"epsg belongs to frame 'projected'"),
        ("forward", "backward", r"unknown key 'backward' in speed; "),
        ("[time]", "[time", r"drive\.csv\.toml"),
    ],
)
def test_a_wrong_declaration_is_told_in_one_line(
    tmp_path: Path, old: str, new: str, told: str
) -> None:
    assert old in DECLARATION
    with pytest.raises(LogError, match=told) as caught:
        open_log(drive(tmp_path, declaration=DECLARATION.replace(old, new, 1)))
    assert "\n" not in str(caught.value)


def test_without_a_declaration_nothing_is_guessed(tmp_path: Path) -> None:
    with pytest.raises(LogError, match=r"units not declared; write drive\.csv\.toml beside it"):
        open_log(drive(tmp_path, declaration=None))


def test_blank_cells_and_rows_are_no_change(tmp_path: Path) -> None:
    """Sources that repeat old values, or leave them out, give each once."""
    rows = (
        "t,lat,lon,v,wheel,fix\n0.0,52.5,13.4,10,1,a\n0.1,52.5,13.4,11,1,a\n ,, ,,,\n\n"
        "0.2,52.5,13.4,12,1,\n0.3,52.5,13.4,13,1,a\n0.4,52.6,13.4,14,1,b\n"
    )
    new_when = DECLARATION.replace("[position]", '[position]\nnew_when = ["fix"]')
    log = open_log(drive(tmp_path, rows, new_when))
    stamps = [m.stamp_ns for channel, m in log.samples() if channel == "gnss"]  # type: ignore[attr-defined]
    assert stamps == [0, 400_000_000]
    assert not log.skipped


def test_grid_headings_become_true_ones(tmp_path: Path) -> None:
    # Away from the central meridian of zone 33 (15° E), grid north points east of true north.
    declaration = """
reference_point = "antenna"
[time]
column = "t"
unit = "s"
base = "log"
[position]
frame = "projected"
epsg = 32633
easting = { column = "e", unit = "m" }
northing = { column = "n", unit = "m" }
[heading]
yaw = { column = "h", unit = "deg" }
zero = "north"
direction = "clockwise"
north = "grid"
"""
    path = drive(tmp_path, "t,e,n,h\n0,700000,5800000,0\n1,700000,5800100,0\n", declaration)
    found = channels(path)
    first, second = (fix.position for fix in found["gnss"])
    east_m, north_m = local_from_geo(LocalFrame(first), second.lat_deg, second.lon_deg)
    course = math.atan2(north_m, east_m)
    assert found["heading"][0].yaw_rad == pytest.approx(course, abs=1e-6)
    assert math.degrees(course) < 88.0


@pytest.mark.parametrize(
    ("unit", "in_feet"), [("ft", 1.0), ("m", 1200.0 / 3937.0), ("km", 1.2 / 3937.0)]
)
def test_a_system_that_counts_in_feet_gets_feet(tmp_path: Path, unit: str, in_feet: float) -> None:
    # New York's plane (EPSG 2263) begins 984,250 feet of the U.S. survey west of 74° W.
    declaration = f"""
reference_point = "antenna"
[time]
column = "t"
unit = "s"
base = "log"
[position]
frame = "projected"
epsg = 2263
easting = {{ column = "e", unit = "{unit}" }}
northing = {{ column = "n", unit = "{unit}" }}
"""
    row = f"{984_250.0 * in_feet:.9f},{200_000.0 * in_feet:.9f}"
    path = drive(tmp_path, f"t,e,n\n0,{row}\n1,{row}\n", declaration)
    position = channels(path)["gnss"][0].position
    assert position.lon_deg == pytest.approx(-74.0, abs=1e-8)
    assert position.lat_deg == pytest.approx(40.7156, abs=1e-3)


def with_keys(section: str, *lines: str) -> str:
    return DECLARATION.replace(f"[{section}]", "\n".join((f"[{section}]", *lines)))


def test_what_stands_for_long_is_new_again(tmp_path: Path) -> None:
    rows = "t,lat,lon,v,wheel\n" + "".join(
        f"{row / 10},52.5,13.4,{v},1\n" for row, v in enumerate([5, 6, 6, 6, 6, 6, 7])
    )
    lines = 'new_when = ["v"]', "again_s = 0.2"
    found = channels(drive(tmp_path, rows, with_keys("speed", *lines)))
    assert [m.stamp_ns // 10**8 for m in found["speed"]] == [0, 1, 3, 5, 6]


def test_late_samples_are_moved_and_none_is_before_the_start(tmp_path: Path) -> None:
    rows = "t,lat,lon,v,wheel\n" + "".join(f"{10 + row / 10},52.5,13.4,5,1\n" for row in range(5))
    found = channels(drive(tmp_path, rows, with_keys("speed", "late_s = 0.15")))
    assert [m.stamp_ns // 10**6 for m in found["speed"]] == [10050, 10150, 10250]
    assert len(found["gnss"]) == 5


def test_decimal_commas_and_columns_without_names(tmp_path: Path) -> None:
    declaration = 'delimiter = ";"\ndecimal = ","\nheader = false\n' + DECLARATION
    for number, name in enumerate(("t", "lat", "lon", "v", "wheel"), start=1):
        declaration = declaration.replace(f'column = "{name}"', f'column = "c{number}"')
    path = drive(tmp_path, "0,5;52,5;13,4;10;90\n0,6;52,5;13,4;20;-45\n", declaration)
    found = channels(path)
    assert [m.stamp_ns for m in found["gnss"]] == [500_000_000, 600_000_000]
    assert found["gnss"][0].position.lat_deg == 52.5
    assert found["steering"][1].steering_wheel_rad == pytest.approx(math.pi / 4)


PLANE = """
reference_point = "rear axle"
[time]
column = "t"
unit = "s"
base = "log"
[position]
frame = "local"
origin = [52.5, 13.4]
x = { column = "lat", unit = "m" }
y = { column = "lon", unit = "m" }
"""


def test_metres_in_a_plane_around_an_origin(tmp_path: Path) -> None:
    path = drive(tmp_path, "t,lat,lon,v,wheel\n0,100,0,1,1\n1,0,200,1,1\n", PLANE)
    places = [fix.position for fix in channels(path)["gnss"]]
    origin = LocalFrame(GeoPoint(52.5, 13.4))
    xy = [local_from_geo(origin, place.lat_deg, place.lon_deg) for place in places]
    assert xy[0] == pytest.approx([100.0, 0.0], abs=1e-3)
    assert xy[1] == pytest.approx([0.0, 200.0], abs=1e-3)
    with pytest.raises(LogError, match="origin belongs to frame 'local'"):
        open_log(drive(tmp_path, declaration=PLANE.replace("origin = [52.5, 13.4]\n", "")))


def test_an_inertial_unit_of_the_plane_is_at_rest_besides(tmp_path: Path) -> None:
    imu = '[imu]\naxes = "forward-right-down"\nrate_z = { column = "wheel", unit = "deg/s" }\n'
    force = 'accel_x = { column = "v", unit = "g" }\n'
    found = channels(drive(tmp_path, declaration=DECLARATION + imu + force))["imu"]
    assert found[0].accel_mps2 == pytest.approx((98.0665, 0.0, 9.80665))
    assert found[0].rate_radps == pytest.approx((0.0, 0.0, -math.pi / 2))
    (gyro, *_) = channels(drive(tmp_path, declaration=DECLARATION + imu))["imu"]
    assert (gyro.accel_mps2, gyro.tells_force) == ((0.0, 0.0, 0.0), False)
    assert gyro.rate_radps == found[0].rate_radps


def test_a_table_without_positions_is_read(tmp_path: Path) -> None:
    kept = DECLARATION[: DECLARATION.index("[position]")]
    speed = DECLARATION[DECLARATION.index("[speed]") :]
    assert channels(drive(tmp_path, declaration=kept + speed)).keys() == {"speed", "steering"}
    with pytest.raises(LogError, match="declares no section but"):
        open_log(drive(tmp_path, declaration=kept))


def test_parquet_is_read_as_its_text_would_be(tmp_path: Path) -> None:
    import pyarrow as pa
    import pyarrow.parquet as pq

    table = {"t": [0.0, 0.1], "lat": [52.5, None], "lon": [13.4, None], "v": [10, 20],
             "wheel": [90.0, -45.0]}  # fmt: skip
    path = tmp_path / "drive.parquet"
    pq.write_table(pa.table(table), path)
    path.with_name("drive.parquet.toml").write_text(DECLARATION)
    found = channels(path)
    assert [len(found[name]) for name in ("gnss", "speed")] == [1, 2]
    assert found["speed"][1].speed_mps == pytest.approx(8.9408)
    path.write_bytes(path.read_bytes()[:60])
    with pytest.raises(LogError, match="no Parquet table that can be read"):
        open_log(path)


def test_many_rows_are_read_as_few_are(tmp_path: Path) -> None:
    rows = [f"{row},52.5,13.4,{row % 50}.25,1" for row in range(20_500)]
    rows[7] = "7,52.5,13.4,,1"
    found = channels(drive(tmp_path, "t,lat,lon,v,wheel\n" + "\n".join(rows) + "\n"))
    assert len(found["speed"]) == 20_499
    assert len(found["steering"]) == 20_500
    assert found["speed"][-1].speed_mps == pytest.approx(49.25 * 0.44704)
