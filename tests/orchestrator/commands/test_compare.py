"""`foretwin compare` as a user runs it: two drives of one road, in text, JSON and a picture."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from foretwin.contracts.arrays import Array
from foretwin.contracts.drive import GnssFix, VehicleInfo
from foretwin.contracts.frames import GeoPoint, geo_from_local
from foretwin.orchestrator.commands.cli import run
from foretwin.telemetry.logs.write_mcap import create
from tests.sim_worker.analysis.two_drives.drawn_drives import BEND, FRAME, LOOP, driven

COVERS = (
    "foretwin.orchestrator.commands.compare_plot",
    "foretwin.orchestrator.commands.compare_text",
)


def recorded(file: Path, way: Array, speed_mps: float, *, left_m: float = 0.0) -> Path:
    """A drive of positions alone, 10 a second."""
    states = driven(way, speed_mps, left_m=left_m)
    info = VehicleInfo(
        vehicle_id="car", time_base="log", start_stamp_ns=0, end_stamp_ns=states[-1].stamp_ns,
        reference_point="base_link", body_from_antenna_m=(0.0, 0.0, 0.0), sends=("gnss",),
    )  # fmt: skip
    with create(file, info=info) as writer:
        for state in states:
            fix = GnssFix(stamp_ns=state.stamp_ns, position=state.position, std_m=0.02)
            writer.add("gnss", fix)
    return file


@pytest.fixture(scope="module")
def pair(tmp_path_factory: pytest.TempPathFactory) -> tuple[str, str]:
    folder = tmp_path_factory.mktemp("pair")
    first = recorded(folder / "first.mcap", BEND, 10.0)
    second = recorded(folder / "second.mcap", BEND, 12.0, left_m=1.0)
    return str(first), str(second)


def test_two_drives_of_a_road_are_compared_in_json(
    pair: tuple[str, str], capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(["compare", *pair, "--json"]) == 0
    said = json.loads(capsys.readouterr().out)
    assert said["first"]["log"] == pair[0]
    assert said["second"]["common_m"] == pytest.approx(said["second"]["length_m"], abs=15.0)
    found = said["differences"]
    assert found["lateral_m"]["p50"] == pytest.approx(1.0, abs=0.1)
    assert found["speed_mps"]["p50"] == pytest.approx(2.0, abs=0.1)
    assert found["time_per_100m_s"]["p50"] == pytest.approx(100 / 12 - 10, abs=0.2)
    assert [row["horizon_s"] for row in said["after"]] == [1.0, 2.0, 4.0, 8.0]
    assert said["unplaced"] == []
    (stretch,) = said["stretches"]
    assert stretch["first_took_s"] - stretch["second_took_s"] == pytest.approx(
        stretch["length_m"] * (1 / 10 - 1 / 12), abs=1.0
    )
    places = stretch["places"]
    assert np.diff([one["first_m"] for one in places]) == pytest.approx(10.0, abs=2.0)
    on_way = geo_from_local(FRAME, np.array([[100.0, 1.0]]))[0]
    nearest = min(places, key=lambda one: abs(one["lon_deg"] - on_way[1]))
    assert nearest["lat_deg"] == pytest.approx(on_way[0], abs=2e-6)
    assert places[-1]["time_per_100m_s"] is None  # the road ends before


def test_the_text_is_80_columns_wide_and_the_picture_is_written(
    pair: tuple[str, str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(["compare", *pair, "--out", str(tmp_path / "drawn")]) == 0
    said = capsys.readouterr().out
    assert "in common" in said
    assert "in 1 passage\n" in said
    paths = (pair[0], pair[1], str(tmp_path))
    table = [line for line in said.splitlines() if not any(path in line for path in paths)]
    assert max(map(len, table)) <= 80
    assert (tmp_path / "drawn/compare.png").read_bytes().startswith(b"\x89PNG")


def test_a_drive_is_compared_with_itself_where_it_came_again(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    laps = str(recorded(tmp_path / "laps.mcap", np.concatenate([LOOP, LOOP[1:]]), 8.0))
    assert run(["compare", laps, laps]) == 0
    said = capsys.readouterr().out
    assert said.count(laps) == 1
    once = str(recorded(tmp_path / "once.mcap", BEND, 8.0))
    assert run(["compare", once, once]) == 2
    assert "drives no 30 m of its way a second time" in capsys.readouterr().err


def test_that_two_recordings_are_of_one_drive_is_said(
    pair: tuple[str, str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    copy = str(recorded(tmp_path / "copy.mcap", BEND, 10.0))
    told = "copy.mcap are recordings of one drive, at one time at one place: they say nothing"

    assert run(["compare", pair[0], copy, "--json"]) == 0
    said = capsys.readouterr()
    assert told in said.err
    assert json.loads(said.out)["one_drive"]
    assert run(["compare", *pair, "--json"]) == 0
    said = capsys.readouterr()
    assert said.err == ""
    assert not json.loads(said.out)["one_drive"]


def test_what_cannot_be_compared_is_said_in_one_line(
    pair: tuple[str, str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    away = str(recorded(tmp_path / "away.mcap", BEND + np.array([0.0, 700.0]), 8.0))
    back = str(recorded(tmp_path / "back.mcap", BEND[::-1], 8.0))
    still = tmp_path / "still.mcap"
    info = VehicleInfo(vehicle_id="car", time_base="log", start_stamp_ns=0, sends=("gnss",))
    with create(still, info=info) as writer:
        for k in range(100):
            writer.add("gnss", GnssFix(stamp_ns=k * 10**8, position=GeoPoint(48.0, 9.0)))
    cases = (
        ([pair[0], away], "come within 405 m of each other"),
        ([pair[0], back], "but one was driven the other way round"),
        ([pair[0], str(still)], "still.mcap: the car does not move with a known heading"),
        ([pair[0], str(tmp_path / "none.mcap")], "none.mcap"),
    )
    for arguments, told in cases:
        assert run(["compare", *arguments]) == 2
        error = capsys.readouterr().err.strip()
        assert told in error
        assert "\n" not in error


def test_a_gap_is_told_beside_how_far_people_differ(
    pair: tuple[str, str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    again = str(recorded(tmp_path / "again.mcap", BEND, 10.2))
    assert run(["gap", pair[0], "--against", again, "--json"]) == 0
    said = json.loads(capsys.readouterr().out)
    assert said["against"]["log"] == again
    after = {row["horizon_s"]: row for row in said["against"]["after"]}
    assert after[4.0]["along_m"]["p50"] == pytest.approx(0.8, abs=0.1)
    # The road's last 4 s, at the least, are too near its end.
    assert 4 <= after[4.0]["left_out"] <= 5
    assert said["rows"]
    assert run(["gap", pair[0], "--against", again]) == 0
    told = capsys.readouterr().out
    assert "left out: so near the end of a passage that a car may be past it by then" in told
    assert told.index("what a gap is measured against") < told.index("RMS of the gap")
    away = str(recorded(tmp_path / "away.mcap", BEND + np.array([0.0, 700.0]), 8.0))
    assert run(["gap", pair[0], "--against", away]) == 2
    assert "no 30 m of road in common" in capsys.readouterr().err
