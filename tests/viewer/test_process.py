"""The viewer process over a real bus: what is in the file after each way to end."""

from __future__ import annotations

import contextlib
import os
import signal
import subprocess
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from rerun.chunk import RrdReader

from foretwin.contracts.bus import Mailbox
from foretwin.contracts.codec import MAGIC
from foretwin.contracts.drive import VehicleInfo
from foretwin.contracts.keys import alive_key
from foretwin.contracts.keys import key as channel_key
from foretwin.contracts.ports import free_port
from foretwin.contracts.segments import Roll, segments_of
from foretwin.contracts.simulation import RunEnd
from foretwin.viewer.live_viewer import address, start_program, wait_until_it_answers
from tests.contracts.bus_sides import DEADLINE_S
from tests.viewer import scene
from tests.viewer.conftest import RUN, ViewerRun, wait_until
from tests.viewer.readback import Recorded

COVERS = ("foretwin.viewer.__main__",)

StartViewer = Callable[..., ViewerRun]


def _end_run(run: ViewerRun) -> None:
    run.bus.publish("run_end", RunEnd(stamp_ns=scene.START_NS), run=RUN)


def _readable_until(path: Path, time_s: float) -> bool:
    try:
        times_s = Recorded(path).times_s("/world/ego/real")
    except Exception:  # the file is being written
        return False
    return len(times_s) > 0 and bool(times_s[-1] >= time_s)


def test_a_whole_drive_is_in_the_file(start_viewer: StartViewer) -> None:
    run = start_viewer()
    run.send(scene.drive())
    _end_run(run)
    assert run.process.wait(DEADLINE_S) == 0

    recorded = Recorded(run.recording)
    world = f"/world/map/{scene.WORLD_ID}"
    assert recorded.paths >= {
        *(f"/world/ego/{car}" for car in ("real", "twin", "shadow", "ghost")),
        *(
            f"/gap/{quantity}/{curve}"
            for quantity in ("pos_m", "yaw_deg", "speed_mps")
            for curve in ("twin", "shadow", "limit")
        ),
        *(
            f"/comparison/ade_m/{horizon}/{name}"
            for horizon in (1, 2, 4, 8)
            for name in ("nominal", "constant_velocity", "constant_turn_rate")
        ),
        *(
            f"{world}/{part}"
            for part in (
                "roads/surface",
                "roads/lanes",
                "crossings",
                "stop_lines",
                "buildings",
                "signals",
                "islands",
            )
        ),
        "/world/ego/trail/real",
        "/world/futures",
        "/world/plan",
        "/scenarios/table",
        "/events",
        f"/geo/roads/{scene.WORLD_ID}",
        "/geo/ego/real",
        "/status",
        "/workers/state/w0",
        "/workers/rtf/w1",
    }
    assert len(recorded.times_s("/world/futures")) == 40
    assert len(recorded.times_s("/gap/pos_m/twin")) == 200
    np.testing.assert_allclose(
        recorded.times_s("/comparison/ade_m/8/nominal"), np.arange(40) / 2.0, atol=1e-9
    )
    cars = recorded.times_s("/world/ego/real")
    assert len(cars) == 200
    assert cars[-1] == pytest.approx(19.9)
    assert RrdReader(run.recording).blueprints(), "the layout is missing"


def test_sigterm_completes_the_file(start_viewer: StartViewer) -> None:
    run = start_viewer()
    run.send(scene.drive(duration_s=2.0))
    wait_until(lambda: _readable_until(run.recording, 1.9))
    run.process.send_signal(signal.SIGINT)
    run.process.terminate()
    assert run.process.wait(DEADLINE_S) == 0
    assert RrdReader(run.recording).store().schema().entity_paths()


def test_the_file_is_complete_when_the_orchestrator_is_lost(start_viewer: StartViewer) -> None:
    from foretwin.contracts.bus import ZenohBus
    from foretwin.contracts.setup import ViewerSetup, read_setup

    run = start_viewer(grace_s=1.0)
    setup = read_setup(run.recording.parent / "viewer.json", ViewerSetup)
    with ZenohBus(setup.bus) as orchestrator:
        orchestrator.declare_alive(alive_key(run=RUN, process="orchestrator"))
        run.send(scene.drive(duration_s=2.0))
        wait_until(lambda: _readable_until(run.recording, 1.9))
        assert run.process.poll() is None
    assert run.process.wait(DEADLINE_S) == 0
    assert RrdReader(run.recording).store().schema().entity_paths()


def test_a_killed_viewer_leaves_what_it_had(start_viewer: StartViewer) -> None:
    run = start_viewer()
    run.send(scene.drive(duration_s=2.0))
    wait_until(lambda: _readable_until(run.recording, 1.9))
    run.process.kill()
    run.process.wait()
    assert len(Recorded(run.recording).times_s("/world/ego/real")) == 20


def test_a_missing_world_and_foreign_bytes_become_events(start_viewer: StartViewer) -> None:
    run = start_viewer()
    (run.recording.parent / "worlds" / f"{scene.WORLD_ID}.world").unlink()
    state = channel_key("state", vehicle="car")
    run.bus._session.put(state, MAGIC + b"\x09\x00" + bytes(18))
    run.send(scene.drive(duration_s=1.0))
    _end_run(run)
    assert run.process.wait(DEADLINE_S) == 0
    recorded = Recorded(run.recording)
    told = " ".join(str(text) for text in recorded.values("/events", ":text"))
    assert f"World {scene.WORLD_ID} is not shown" in told
    assert "schema version 9" in told
    assert len(recorded.times_s("/world/ego/real")) == 10


def test_the_vehicle_is_asked_when_its_drive_began(start_viewer: StartViewer) -> None:
    run = start_viewer(start_stamp_ns=0)
    asked = Mailbox(1)
    run.bus.serve("info", asked, vehicle="car")
    run.send(m for m in scene.drive(duration_s=4.0) if m.channel == "state" and _late(m))
    question = asked.take(DEADLINE_S)
    question.reply(VehicleInfo(vehicle_id="car", time_base="utc", start_stamp_ns=scene.START_NS))
    _end_run(run)
    assert run.process.wait(DEADLINE_S) == 0
    assert Recorded(run.recording).times_s("/world/ego/real")[0] == pytest.approx(2.0)


def _late(message: scene.Message) -> bool:
    return bool(message.message.stamp_ns >= scene.START_NS + 2_000_000_000)


def test_without_a_display_the_drive_goes_on_and_says_so(
    start_viewer: StartViewer, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in ("DISPLAY", "WAYLAND_DISPLAY", "WAYLAND_SOCKET"):
        monkeypatch.delenv(name, raising=False)
    run = start_viewer(live="native")
    run.send(scene.drive(duration_s=1.0))
    wait_until(lambda: run.logged("no live view"))
    _end_run(run)
    assert run.process.wait(DEADLINE_S) == 0
    recorded = Recorded(run.recording)
    assert any("no live view" in str(text) for text in recorded.values("/events", ":text"))
    assert len(recorded.times_s("/world/ego/real")) == 10


def test_a_frozen_window_holds_up_nothing(start_viewer: StartViewer) -> None:
    port = free_port()
    window: subprocess.Popen[bytes] = start_program("--serve-grpc", port=port)
    try:
        wait_until_it_answers(window, port)
        os.kill(window.pid, signal.SIGSTOP)
        run = start_viewer(live=address(port))
        run.send(scene.drive())
        _end_run(run)
        assert run.process.wait(DEADLINE_S) == 0
        assert len(Recorded(run.recording).times_s("/world/futures")) == 40
    finally:
        os.kill(window.pid, signal.SIGCONT)
        window.kill()
        window.wait()


def test_a_large_recording_goes_on_in_a_file_that_can_be_shown_alone(
    start_viewer: StartViewer,
) -> None:
    run = start_viewer(roll=Roll(most_s=1.0))
    messages = list(scene.drive(duration_s=20.0))
    second = run.recording.with_name("monitor-002.rrd")
    sent = 0
    while not second.exists():
        run.send(iter(messages[sent : sent + 20]))
        sent += 20
        assert sent < len(messages)
        with contextlib.suppress(subprocess.TimeoutExpired):
            run.process.wait(0.1)
    run.send(iter(messages[sent:]))
    _end_run(run)
    assert run.process.wait(DEADLINE_S) == 0
    parts = [Recorded(part) for part in segments_of(run.recording)]
    shown_s = np.concatenate([part.times_s("/world/ego/real") for part in parts])
    apart_s = np.diff(shown_s)
    assert 0.0 < apart_s.min() < apart_s.max() < 0.15, "nothing missing, nothing twice"
    assert shown_s[-1] > 19.8
    for part in parts[1:]:
        assert {"/about", "/status"} <= part.paths
    for path in segments_of(run.recording):
        assert RrdReader(path).blueprints(), "the layout is missing"
