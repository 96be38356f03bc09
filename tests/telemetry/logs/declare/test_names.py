"""What columns are called says what nothing else does: a grid in feet, beside a real gyro."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pyproj
import pytest

from foretwin.telemetry.logs import open_log
from foretwin.telemetry.logs.declare import propose
from foretwin.telemetry.logs.write_declaration import declaration_toml
from tests.telemetry.logs.declare.disguised import Drive, drive_of


def feet_and_a_gyro(drive: Drive, path: Path) -> None:
    """Write a row for each position and each sensor: both sensors' rows share their stamps."""
    gnss, speed, imu = drive["gnss"], drive["speed"], drive["imu"]
    to_grid = pyproj.Transformer.from_crs(4326, 25833, always_xy=True)
    grid = to_grid.transform(gnss.columns["longitude"], gnss.columns["latitude"])
    rate = -np.degrees(np.interp(speed.stamps_ns, imu.stamps_ns, imu.columns["rate_z"]))
    knots = speed.columns["forward"] * 3600.0 / 1852.0
    rows = [
        (stamp, f"{north / 0.3048:.3f},{east / 0.3048:.3f},,")
        for stamp, east, north in zip(gnss.stamps_ns, *grid, strict=True)
    ] + [
        (stamp, f",,{forward:.4f},{turn:.4f}")
        for stamp, forward, turn in zip(speed.stamps_ns, knots, rate, strict=True)
    ]
    lines = [f"{stamp / 1e9 + 8123.0:.4f},{cells}" for stamp, cells in sorted(rows)]
    path.write_text("\n".join(["uptime,hoch_ft,rechts_ft,wheel,gyro", *lines, ""]))


@pytest.mark.real_data
def test_feet_are_feet_and_a_gyro_is_no_steering(data_dir: Path, tmp_path: Path) -> None:
    drive = drive_of(open_log(data_dir / "drive-berlin-potsdamer-platz"))
    path, declared = tmp_path / "feet.csv", tmp_path / "feet.csv.toml"
    feet_and_a_gyro(drive, path)
    asked = propose(path).question
    assert asked is not None
    assert asked.key == "epsg"
    found = propose(path, answers={"epsg": "25833"})
    assert "in ft by their names alone; a speed fits" in found.evidence["position"]
    assert any("gyro: steering.tire in deg or imu.rate_z" in line for line in found.unknown)
    assert found.declaration is not None
    assert found.declaration.steering is None
    assert found.declaration.speed is not None
    assert found.declaration.speed.forward is not None
    assert found.declaration.speed.forward.unit == "kn"
    declared.write_text(declaration_toml(found.declaration))
    read, truth = drive_of(open_log(path))["gnss"].columns, drive["gnss"].columns
    for name in ("latitude", "longitude"):
        assert read[name] == pytest.approx(truth[name], abs=1e-8)


def test_of_two_receivers_columns_those_that_are_called_alike_belong_together(
    tmp_path: Path,
) -> None:
    """As in logs of an app that tells the telephone's place and that of its receiver's driver."""
    time_s = np.arange(600.0)
    yaw = np.cumsum(0.05 * np.sin(time_s / 15.0))
    speed = 9.0 + 4.0 * np.sin(time_s / 20.0)
    north, east = np.cumsum(speed * np.sin(yaw)), np.cumsum(speed * np.cos(yaw))
    lat, lon = 48.1 + north / 111_195.0, 11.6 + east / 111_195.0 / np.cos(np.radians(48.1))
    rows = [
        f"{one_lat:.9f},{one_lon:.9f},{3.6 * fast:.3f},{one_lat:.7f},{one_lon:.7f},{at:.1f}"
        for one_lat, one_lon, fast, at in zip(lat, lon, speed, time_s, strict=True)
    ]
    names = "Latitude,Longitude,Speed,GPS Latitude,GPS Longitude,Time"
    path = tmp_path / "app.csv"
    path.write_text("\n".join([names, *rows, ""]))
    found = propose(path)
    assert found.question is None
    assert found.declaration is not None
    position = found.declaration.position
    assert position is not None
    assert position.latitude is not None
    assert position.longitude is not None
    pair = (position.latitude.column, position.longitude.column)
    assert pair in [("Latitude", "Longitude"), ("GPS Latitude", "GPS Longitude")]
