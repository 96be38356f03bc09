"""`foretwin standin`: what cannot be used is said in one line; what came of it in a sentence."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from foretwin.contracts import anchor_file
from foretwin.contracts.anchor_file import read_anchor
from foretwin.contracts.bus import BusUnreachable
from foretwin.contracts.frames import geo_from_local
from foretwin.orchestrator.commands import standin
from foretwin.orchestrator.commands.cli import run
from foretwin.orchestrator.commands.standin import told, way_in_world
from foretwin.telemetry.lot_car.lot_car import LotReport
from foretwin.telemetry.standin.parameters import read_parameters
from foretwin.telemetry.standin.path import DrivenPath
from tests.telemetry.lot_car.test_braking import MAPPING

COVERS = ("foretwin.orchestrator.commands.cli_standin",)
EXAMPLE = (anchor_file.__doc__ or "").split("```toml\n")[1].split("```")[0]


@pytest.fixture
def files(tmp_path: Path) -> tuple[Path, Path]:
    ros2, anchor = tmp_path / "car.toml", tmp_path / "lot.toml"
    text = MAPPING.format(dialect="ros2dds", objects="PredictedObjects", lat=52.5, lon=13.4)
    ros2.write_text('endpoint = "tcp/127.0.0.1:1"\n' + text, encoding="utf-8")
    anchor.write_text(EXAMPLE, encoding="utf-8")
    return ros2, anchor


@pytest.mark.parametrize(
    ("flags", "says"),
    [
        (["--way", "-1"], "--way -1.0: above 0"),
        (["--speed", "0"], "--speed 0.0: above 0"),
        (["--end", "nan"], "--end nan: above 0"),
    ],
)
def test_numbers_that_cannot_be_meant_are_refused(
    files: tuple[Path, Path], flags: list[str], says: str, capsys: pytest.CaptureFixture[str]
):
    ros2, anchor = map(str, files)
    assert run(["standin", "--ros2", ros2, "--anchor", anchor, *flags]) == 2
    assert says in capsys.readouterr().err


def test_a_mapping_without_the_cars_router_is_refused(
    files: tuple[Path, Path], capsys: pytest.CaptureFixture[str]
):
    ros2, anchor = files
    ros2.write_text(ros2.read_text().replace('endpoint = "tcp/127.0.0.1:1"\n', ""))
    assert run(["standin", "--ros2", str(ros2), "--anchor", str(anchor)]) == 2
    assert "endpoint must be named" in capsys.readouterr().err


def test_a_router_that_is_not_there_is_told_in_a_line(
    files: tuple[Path, Path], capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
):
    def nobody(_: object) -> None:
        raise BusUnreachable("no router")

    monkeypatch.setattr(standin, "ZenohForeignBus", nobody)
    assert run(["standin", "--ros2", str(files[0]), "--anchor", str(files[1])]) == 2
    said = capsys.readouterr().err
    assert said.endswith("car.toml: endpoint tcp/127.0.0.1:1: nobody listens there\n")
    assert said.count("\n") == 1


@pytest.mark.parametrize("scale", [1.0, 10.0])
def test_the_way_goes_straight_on_or_along_a_line_of_the_world(
    files: tuple[Path, Path], tmp_path: Path, scale: float
):
    """What is asked for is of the lot, where a car of 1:10 drives a tenth as far and as fast."""
    files[1].write_text(EXAMPLE.replace("scale = 1.0", f"scale = {scale}"), encoding="utf-8")
    anchor, driver = read_anchor(files[1]), read_parameters().driver
    way = way_in_world(anchor, route=None, way_m=80.0, speed_mps=2.0)
    path = DrivenPath(*way, driver=driver)
    assert path.length_m == pytest.approx(80.0 * scale, abs=0.1)
    assert way.speed_mps.tolist() == [2.0 * scale] * 2
    assert path.at(0.0).yaw_rad == pytest.approx(anchor.world.yaw_rad, abs=1e-3)
    assert (path.frame.origin.lat_deg, path.frame.origin.lon_deg) == pytest.approx(
        (anchor.world.lat_deg, anchor.world.lon_deg)
    )
    line = geo_from_local(anchor.world.frame, np.array([[0.0, 0.0], [0.0, 50.0]]))
    points = "".join(f'<trkpt lat="{lat:.9f}" lon="{lon:.9f}"/>' for lat, lon in line)
    route = tmp_path / "route.gpx"
    route.write_text(f'<gpx version="1.1"><trk><trkseg>{points}</trkseg></trk></gpx>')
    there = way_in_world(anchor, route=route, way_m=80.0, speed_mps=2.0)
    assert DrivenPath(*there, driver=driver).length_m == pytest.approx(50.0, abs=0.1)
    assert np.stack(there[:2], axis=1) == pytest.approx(line, abs=1e-8)


def test_what_came_of_it_is_said_in_a_sentence():
    none = LotReport(
        lists=0, latency_ms_p50=None, latency_ms_p95=None, brakes=(), braked_at_m=None,
        stood_before_m=None, driven_m=0.0,
    )  # fmt: skip
    assert told(none) == "heard of no objects, and did not set off"
    heard = {"lists": 90, "latency_ms_p50": 6.2, "latency_ms_p95": 14.8}
    assert told(LotReport(**{**fields(none), **heard, "driven_m": 98.0})) == (
        "90 lists of objects, 6 ms (95 %: 15 ms) after the state that they are of; braked for "
        "nobody on 98 m"
    )
    stood = {"brakes": ("pedestrian",), "braked_at_m": 21.04, "stood_before_m": 1.96}
    assert told(LotReport(**{**fields(none), **heard, **stood})).endswith(
        "braked for pedestrian, at first 21.0 m ahead: stood 2.0 m before"
    )


def fields(report: LotReport) -> dict[str, object]:
    return {name: getattr(report, name) for name in report.__struct_fields__}
