"""`foretwin judge` as a user runs it."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
import pytest

from foretwin.contracts.codec import read_message
from foretwin.contracts.drive import ControlMode, PlannedTrajectory, VehicleStatus
from foretwin.contracts.provenance import Choice
from foretwin.contracts.versions import versions
from foretwin.contracts.world import StopLine, World
from foretwin.orchestrator.commands import judge
from foretwin.orchestrator.commands.cli import run
from foretwin.orchestrator.config import DriveConfig
from foretwin.orchestrator.embedded import MAP_FILE
from foretwin.telemetry.logs import open_log
from foretwin.telemetry.logs.write_mcap import create
from foretwin.world_gen.world_store import WorldStore
from tests.orchestrator.trip import town_world
from tests.system.foretwin_command import environment, foretwin

COVERS = ("foretwin.orchestrator.commands.judge",)


@pytest.mark.parametrize(
    ("files", "said"),
    [
        ({}, "no run.json in it"),
        ({"run.json": "{}"}, "no drive.mcap in it"),
        ({"run.json": "nonsense", "drive.mcap": ""}, "not JSON"),
        ({"run.json": '{"exit": "running"}', "drive.mcap": ""}, "never came to its end"),
        ({"run.json": "{}", "drive.mcap": ""}, "never came to its end (exit: not told)"),
        ({"run.json": "[]", "drive.mcap": ""}, "must be a JSON object"),
        ({"run.json": '{"config": {}}', "drive.mcap": ""}, "another version"),
        (
            {"run.json": '{"config": {"wheels": 4}, "map": {"file": "m"}}', "drive.mcap": ""},
            "of another version of foretwin",
        ),
    ],
)
def test_a_folder_that_is_no_run_is_told_in_one_line(
    files: dict[str, str], said: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    for name, text in files.items():
        (tmp_path / name).write_text(text)
    assert run(["judge", str(tmp_path)]) == 2
    told = capsys.readouterr().err.strip()
    assert said in told
    assert "\n" not in told


def test_a_judgement_without_a_correction_is_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    config = DriveConfig(workers=100_000)  # of a larger machine, which is no reason to refuse
    record = {"config": msgspec.to_builtins(config), "map": {"file": str(MAP_FILE)}}
    (tmp_path / "run.json").write_text(json.dumps(record))
    (tmp_path / "drive.mcap").write_bytes(b"")
    assert run(["judge", str(tmp_path)]) == 2
    assert "name what is corrected, by --map FILE" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("changed", "stands"),
    [
        ({}, True),
        ({"config": {"speed": 1.0}}, False),
        ({"exit": "recovered"}, False),
        ({"versions": {"foretwin": "of old"}}, False),
    ],
)
def test_what_a_run_is_compared_with(changed: dict[str, Any], stands: bool) -> None:
    record = {"config": {"speed": None}, "exit": "completed", "versions": versions()}
    assert judge._stands_for_itself(record | changed) is stands


def test_a_world_beside_the_way_is_told_in_one_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    record = {
        "config": msgspec.to_builtins(DriveConfig()), "map": {"file": str(MAP_FILE)},
        "intersections": [{"id": "n7"}],
    }  # fmt: skip
    (tmp_path / "run.json").write_text(json.dumps(record))
    (tmp_path / "drive.mcap").write_bytes(b"")
    given = WorldStore(tmp_path / "given")
    given.save(town_world("n4"))
    assert run(["judge", str(tmp_path), "--worlds", str(given.folder)]) == 2
    told = capsys.readouterr().err.strip()
    assert "that of junction n4 does not belong to the way of" in told
    assert told.endswith("its junctions are n7")
    assert run(["judge", str(tmp_path), "--worlds", str(tmp_path / "nowhere")]) == 2
    assert "nowhere: no such folder" in capsys.readouterr().err


def with_stop_sign() -> str:
    """The drawn town with a stop sign 8 m before its first junction, which its map forgot."""
    text = MAP_FILE.read_text(encoding="utf-8")
    sign = (
        '<node id="99003" version="1" lat="44.9999891" lon="-30.003526"><tag k="highway" v="stop"/>'
        '<tag k="direction" v="forward"/></node>'
    )
    text = text.replace('<node id="5" ', f'{sign}<node id="5" ', 1)
    return text.replace(
        '<nd ref="3"/>\n    <nd ref="4"/>', '<nd ref="3"/><nd ref="99003"/><nd ref="4"/>', 1
    )


def recorded(out: Path) -> Path:
    """Drive past the first junction, and return the run."""
    driven = foretwin(
        out, "--speed", "max", "--futures", "16", "--rate", "1", "--end", "22", "--workers", "1"
    )
    assert driven.code == 0, driven.screen
    assert driven.run is not None
    return driven.run


@pytest.mark.judge
def test_a_forgotten_stop_sign_changes_the_verdict_of_a_recorded_drive(tmp_path: Path) -> None:
    run = recorded(tmp_path / "runs")
    corrected = tmp_path / "corrected.osm"
    corrected.write_text(with_stop_sign(), encoding="utf-8")
    answers = []
    for map_file in (corrected, MAP_FILE):
        done = subprocess.run(
            [sys.executable, "-P", "-m", "foretwin", "judge", str(run), "--json",
             "--map", str(map_file)],
            env=environment(tmp_path / "cache"), capture_output=True, text=True, timeout=300,
            check=False,
        )  # fmt: skip
        assert done.returncode == 0, done.stderr
        answers.append(json.loads(done.stdout))
    changed, same = answers
    assert changed["outcomes"]
    for one in changed["outcomes"]:
        assert "stop_line" not in one["before"]["observable"]
        assert one["after"]["driven_fails"] == "stop_line"
    # By its own map nothing changes: the recorded drive is the drive.
    assert same["outcomes"] == []
    assert same["gap"]["nominal_ade_m"]["before"] == same["gap"]["nominal_ade_m"]["after"]


def with_stop_lines(world: World) -> World:
    """The World with a stop sign where each of its lanes comes to the junction."""
    entered = {one.from_lane_id for one in world.connections}
    lines = []
    for lane in world.lanes:
        if lane.id in entered and lane.role == "approach":
            (before, end), half_m = lane.centerline[-2:], 0.5 * lane.width_m.value
            along = (end - before) / np.hypot(*(end - before))
            left = half_m * np.array([-along[1], along[0]])
            ends = np.stack([end + left, end - left])
            control = Choice("stop", "tagged")
            lines.append(StopLine(id=f"s{lane.id}", lane_id=lane.id, ends=ends, control=control))
    assert lines
    return msgspec.structs.replace(world, stop_lines=tuple(lines))


@pytest.mark.judge
@pytest.mark.timeout(900)
def test_a_world_corrected_by_hand_changes_the_verdict_of_a_recorded_drive(tmp_path: Path) -> None:
    run = recorded(tmp_path / "runs")
    given = WorldStore(tmp_path / "given")
    for file in (run / "worlds").glob("*.world"):
        world = read_message(file, World)
        given.save(with_stop_lines(world) if world.intersection.id == "n4" else world)
    done = subprocess.run(
        [sys.executable, "-P", "-m", "foretwin", "judge", str(run), "--json",
         "--worlds", str(given.folder)],
        env=environment(tmp_path / "cache"), capture_output=True, text=True, timeout=300,
        check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    changed = json.loads(done.stdout)
    assert changed["after"]["worlds"] == str(given.folder)
    assert changed["outcomes"]
    for one in changed["outcomes"]:
        assert "stop_line" not in one["before"]["observable"]
        assert one["after"]["driven_fails"] == "stop_line"


@pytest.mark.judge
def test_a_disagreement_injected_into_a_recording_is_listed_where_it_is(tmp_path: Path) -> None:
    """A stand-in's drive, told to be a human's for 15 s, in which the software would have taken
    the other lane from 6 s to 9 s."""
    driven = foretwin(
        tmp_path / "runs", "--speed", "max", "--futures", "4", "--rate", "0.2", "--end", "22",
        "--workers", "1",
    )  # fmt: skip
    assert driven.run is not None, driven.screen
    log = open_log(driven.run / "drive.mcap")
    with create(tmp_path / "injected.mcap", info=log.info) as writer:
        for channel, message in log.samples():
            at_s = (message.stamp_ns - log.info.start_stamp_ns) / 1e9
            if isinstance(message, VehicleStatus):
                mode: ControlMode = "manual" if at_s < 15.0 else "autonomous"
                message = msgspec.structs.replace(message, control_mode=mode)
            elif isinstance(message, PlannedTrajectory) and 6.0 <= at_s < 9.0:
                north = 3.5 / 111_200.0 * np.clip(message.time_from_stamp_s / 3.0, 0.0, 1.0)
                message = msgspec.structs.replace(message, lat_deg=message.lat_deg + north)
            writer.add(channel, message)
    again = foretwin(
        tmp_path / "again", "--speed", "max", "--futures", "4", "--rate", "0.2", "--workers", "1",
        "--map", str(MAP_FILE), "--log", str(tmp_path / "injected.mcap"),
        "--route", "from-log",
    )  # fmt: skip
    assert again.code == 0, again.screen
    (one,) = again.rows("disagreements")
    assert one["kind"] == "ads_in_another_lane"
    assert one["lateral_m"] == pytest.approx(3.4, abs=0.4)
    assert (one["duration_s"], one["junction_id"]) == (pytest.approx(2.8, abs=0.4), "n4")
    human, software = again.record()["side_by_side"]["segments"]
    assert (human["control_mode"], software["control_mode"]) == ("manual", "autonomous")
    assert software["lateral_m"] < 0.5
