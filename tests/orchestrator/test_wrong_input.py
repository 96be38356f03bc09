"""Wrong input ends with one line that names it, exit code 2, and leaves the runs' folder alone."""

from __future__ import annotations

import socket
import subprocess
import sys
from pathlib import Path

import pytest

from foretwin.orchestrator.commands.cli import run
from foretwin.orchestrator.embedded import MAP_FILE, ROUTE_FILE

COVERS = ("foretwin.orchestrator.commands.cli",)

GPX = """<?xml version="1.0"?>
<gpx version="1.1" creator="test" xmlns="http://www.topografix.com/GPX/1/1"><trk><trkseg>
{points}
</trkseg></trk></gpx>
"""
EMPTY_MAP = '<?xml version="1.0"?>\n<osm version="0.6" generator="test"></osm>\n'


def gpx(path: Path, *, lat: float, lon: float, times: bool = True) -> Path:
    points = "\n".join(
        f'<trkpt lat="{lat}" lon="{lon + number * 1e-4:.6f}">'
        + (f"<time>2026-01-01T00:00:{number:02d}Z</time>" if times else "")
        + "</trkpt>"
        for number in range(20)
    )
    path.write_text(GPX.format(points=points))
    return path


def refused(
    arguments: list[str], named: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "runs"
    code = run(["drive", *arguments, "--view", "none", "--out", str(out)])
    error = capsys.readouterr().err.strip()
    assert code == 2, error
    assert "\n" not in error
    assert named in error
    assert "Traceback" not in error
    assert not out.exists()


@pytest.fixture
def town_log(tmp_path: Path) -> Path:
    return gpx(tmp_path / "town.gpx", lat=45.0, lon=-30.003)


def test_a_missing_map(tmp_path: Path, town_log: Path, capsys: pytest.CaptureFixture[str]) -> None:
    refused(["--map", "no.osm", "--log", str(town_log)], "no.osm", tmp_path, capsys)


def test_a_missing_log(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    refused(["--map", str(MAP_FILE), "--log", "no.gpx"], "no.gpx", tmp_path, capsys)


def test_an_empty_map(tmp_path: Path, town_log: Path, capsys: pytest.CaptureFixture[str]) -> None:
    empty = tmp_path / "empty.osm"
    empty.write_text(EMPTY_MAP)
    refused(["--map", str(empty), "--log", str(town_log)], "empty.osm", tmp_path, capsys)


def test_a_map_of_another_place(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    away = gpx(tmp_path / "away.gpx", lat=10.0, lon=10.0)
    refused(["--map", str(MAP_FILE), "--log", str(away)], "holds no position", tmp_path, capsys)


def test_a_log_without_time(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    timeless = gpx(tmp_path / "timeless.gpx", lat=45.0, lon=-30.003, times=False)
    refused(["--map", str(MAP_FILE), "--log", str(timeless)], "timeless.gpx", tmp_path, capsys)


def test_a_table_without_declared_units(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    table = tmp_path / "table.csv"
    table.write_text("t,lat,lon,v\n0,45.0,-30.003,3\n1,45.0,-30.0029,3\n")
    refused(["--map", str(MAP_FILE), "--log", str(table)], "table.csv", tmp_path, capsys)


def test_an_unknown_planner_names_the_known(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    refused(["--planner", "teleport"], "pure_pursuit_idm", tmp_path, capsys)


def test_a_route_off_the_map(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    away = gpx(tmp_path / "route.gpx", lat=10.0, lon=10.0)
    refused(["--map", str(MAP_FILE), "--route", str(away)], "off the map", tmp_path, capsys)


def test_a_vehicle_file_that_is_none(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = tmp_path / "car.toml"
    file.write_text('name = "half a car"\n')
    refused(["--vehicle", str(file)], "car.toml", tmp_path, capsys)


@pytest.mark.parametrize("name", ["missing.npz", "town.gpx"])
def test_a_progress_table_that_is_none(
    name: str, tmp_path: Path, town_log: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    table = str(town_log.parent / name)
    refused(["--progress-table", table], f"{table}: no table of progress", tmp_path, capsys)


def test_a_window_without_positions(
    tmp_path: Path, town_log: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    refused(
        ["--map", str(MAP_FILE), "--log", str(town_log), "--start", "500"],
        "town.gpx",
        tmp_path,
        capsys,
    )


def test_an_unknown_flag_and_format(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["drive", "--warp"]) == 2
    assert "--warp" in capsys.readouterr().err
    out = tmp_path / "w.stl"
    code = run(["world", str(MAP_FILE), "--at", "45,-30", "--format", "stl", "--out", str(out)])
    assert code == 2
    assert "mjcf, sdf, opendrive" in capsys.readouterr().err


def test_a_place_without_a_junction(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = str(tmp_path / "w.xml")
    assert run(["world", str(MAP_FILE), "--at", "46,-30", "--out", out]) == 2
    assert "nearest intersection" in capsys.readouterr().err


def test_the_embedded_route_is_listed_in_driving_order(
    capsys: pytest.CaptureFixture[str],
) -> None:
    code = run(["intersections", str(MAP_FILE), "--route", str(ROUTE_FILE), "--json"])
    listed = capsys.readouterr().out
    assert code == 0
    kinds = [line.split('"')[3] for line in listed.splitlines() if '"kind"' in line]
    assert kinds == ["t_junction", "roundabout", "crossing", "crossing"]


def test_folders_that_are_files_are_told_before_anything_begins(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file, config = tmp_path / "text.txt", tmp_path / "drive.toml"
    file.write_text("precious")
    config.write_text(f'cache_dir = "{file}"\n')
    refused(["--config", str(config)], "cache_dir", tmp_path, capsys)
    assert run(["drive", "--view", "none", "--out", str(file / "a")]) == 2
    assert capsys.readouterr().err == f"foretwin: --out {file / 'a'}: {file} is no folder\n"


def test_an_endpoint_that_is_taken_is_told_and_leaves_no_run(tmp_path: Path) -> None:
    with socket.create_server(("127.0.0.1", 0)) as other:
        endpoint = f"tcp/127.0.0.1:{other.getsockname()[1]}"
        (tmp_path / "drive.toml").write_text(f'endpoint = "{endpoint}"\ninsecure = true\n')
        ended = subprocess.run(
            [sys.executable, "-P", "-m", "foretwin", "drive", "--view", "none",
             "--config", "drive.toml"],
            cwd=tmp_path, capture_output=True, text=True, check=False,
        )  # fmt: skip
    assert ended.returncode == 2
    port = endpoint.rsplit(":", 1)[1]
    assert ended.stderr.startswith(f"foretwin: endpoint {endpoint}: port {port} is taken; ")
    assert ended.stderr.count("\n") == 1
    assert not (tmp_path / "runs").exists()
