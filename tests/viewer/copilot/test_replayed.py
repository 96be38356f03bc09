"""A run whose display's frames are kept is shown again, at its pace or at one instant."""

from __future__ import annotations

import subprocess
import sys
from http.client import HTTPConnection
from pathlib import Path
from urllib.parse import urlsplit

import msgspec
import pytest

from foretwin.contracts.codec import write_message
from foretwin.contracts.errors import UserError
from foretwin.contracts.page_address import FRAMES_FILE
from foretwin.contracts.ports import free_port
from foretwin.contracts.process_setup import BusSetup
from foretwin.contracts.setup import CopilotSetup, write_setup
from foretwin.contracts.simulation import ActiveWorld
from foretwin.viewer.copilot.frame import PageFrame
from foretwin.viewer.copilot.frames_file import FramesWriter
from foretwin.viewer.copilot.replayed import AGAIN_S, ReplayedRun
from foretwin.viewer.copilot.server import CannotError, MarkAsked
from tests.contracts.bus_sides import DEADLINE_S
from tests.viewer import scene
from tests.viewer.copilot.test_now import Drive


def run_with_frames(folder: Path) -> Path:
    """Make the folder of a run whose frames are of 1, 2 and 3 s."""
    for sub in ("worlds", "processes"):
        (folder / sub).mkdir(parents=True)
    write_message(scene.junction(), folder / "worlds" / f"{scene.WORLD_ID}.world")
    setup = CopilotSetup(
        run_id="r1",
        process_id="copilot",
        vehicle_id="car",
        bus=BusSetup(endpoint="x"),
        log_file="x",
        port=1,
        drive_frame=scene.DRIVE_FRAME,
    )
    write_setup(setup, folder / "processes" / "copilot.json")
    writer, drive = FramesWriter(folder / FRAMES_FILE, 0.0), Drive()
    drive.take("active_world", ActiveWorld(stamp_ns=1, world_id=scene.WORLD_ID))
    for time_s in (1.0, 2.0, 3.0):
        drive.goes_on(time_s)
        writer.add(msgspec.json.encode(drive.frame()), time_s)
    writer.write()
    return folder


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    return run_with_frames(tmp_path)


def test_it_goes_at_the_drives_pace_and_begins_again(folder: Path) -> None:
    run = ReplayedRun(folder)
    begun_s = run._begun_s
    assert [run.turn_s(begun_s + passed) for passed in (0.0, 1.5)] == pytest.approx([1.0, 2.5])
    assert run.turn_s(begun_s + 2.0 + AGAIN_S + 0.5) == pytest.approx(1.5)


def test_of_a_run_any_instant_can_be_had_and_nothing_marked(folder: Path) -> None:
    run = ReplayedRun(folder)
    assert msgspec.json.decode(run.frame_at(2.4), type=PageFrame).drive_s == pytest.approx(2.0)
    assert run.plan_of(scene.WORLD_ID) is not None
    assert run.plan_of("../../secret") is None
    with pytest.raises(CannotError, match="replay"):
        run.actions.mark(MarkAsked())
    assert run.actions.change is None


def test_a_world_that_is_gone_is_no_error(folder: Path) -> None:
    (folder / "worlds" / f"{scene.WORLD_ID}.world").unlink()
    assert ReplayedRun(folder).plan_of(scene.WORLD_ID) is None


def test_a_run_without_frames_or_setup_is_said_in_a_line(folder: Path) -> None:
    (folder / "processes" / "copilot.json").write_text("{}")
    with pytest.raises(UserError, match="cannot be read"):
        ReplayedRun(folder)
    (folder / FRAMES_FILE).unlink()
    with pytest.raises(UserError, match="--view copilot keeps them"):
        ReplayedRun(folder)


def test_its_process_says_where_and_answers_there(folder: Path) -> None:
    command = [sys.executable, "-P", "-m", "foretwin.viewer.copilot", "--replay", str(folder)]
    command += ["--port", str(free_port())]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        line = process.stdout.readline()
        assert "1 to 3 s of the drive" in line
        place = urlsplit(next(word for word in line.split() if word.startswith("http")))
        connection = HTTPConnection(place.netloc, timeout=DEADLINE_S)
        connection.request("GET", f"{place.path}frame?at=2")
        assert msgspec.json.decode(connection.getresponse().read())["drive_s"] == 2.0
        connection.close()
        process.terminate()
        assert process.wait(DEADLINE_S) == 0


def test_its_process_says_what_is_wrong_in_a_line(tmp_path: Path) -> None:
    said = subprocess.run(
        [sys.executable, "-P", "-m", "foretwin.viewer.copilot", "--replay", str(tmp_path)],
        capture_output=True,
        text=True,
        timeout=DEADLINE_S,
        check=False,
    )
    assert said.returncode == 2
    assert said.stderr.startswith("foretwin: ")
    assert said.stderr.count("\n") == 1
