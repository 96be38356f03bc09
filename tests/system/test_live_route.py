"""A live car says where its driving stack is on its way to, and the drive follows that route."""

from __future__ import annotations

import json
import signal
import time
from pathlib import Path

import numpy as np
import pytest

from foretwin.contracts.bus import ZenohBus
from foretwin.contracts.foreign_bus import ZenohForeignBus
from foretwin.contracts.frames import GeoPoint, LocalFrame, local_from_geo
from foretwin.contracts.ports import free_endpoint
from foretwin.contracts.setup import BusSetup
from foretwin.orchestrator.embedded import ROUTE_FILE
from foretwin.telemetry.logs import read_line
from foretwin.telemetry.ros2.mapping import AUTOWARE
from foretwin.telemetry.ros_messages.parts import (
    LANELET_ROUTE,
    header_from,
    pose_from,
)
from tests.system.foretwin_command import log_lines, run_folder, started, wait_for
from tests.system.ros2_car import Ros2Car
from tests.telemetry.ros2.gateway_ground import cdr

FLAGS = ("--source", "live", "--route", "live", "--futures", "8", "--workers", "1")


def lanelet_route(line_deg: np.ndarray, map_frame: LocalFrame) -> bytes:
    """From the line's beginning to its end."""
    xy_m = local_from_geo(map_frame, line_deg[:, 0], line_deg[:, 1])

    def pose(at: np.ndarray, course: np.ndarray) -> object:
        yaw = float(np.arctan2(course[1], course[0]))
        return pose_from(float(at[0]), float(at[1]), 0.0, yaw)

    return cdr(
        LANELET_ROUTE,
        header=header_from(time.time_ns(), "map"),
        start_pose=pose(xy_m[0], xy_m[1] - xy_m[0]),
        goal_pose=pose(xy_m[-1], xy_m[-1] - xy_m[-2]),
    )


@pytest.mark.judge
@pytest.mark.timeout(180)
def test_the_route_of_the_driving_stack_is_taken_and_followed(tmp_path: Path) -> None:
    endpoint = free_endpoint()
    line_deg = read_line(ROUTE_FILE).lat_lon_deg
    origin = GeoPoint(float(line_deg[0, 0]), float(line_deg[0, 1]))
    place = f"[map]\nlat_deg = {origin.lat_deg!r}\nlon_deg = {origin.lon_deg!r}\n\n[[in]]"
    text = AUTOWARE.read_text(encoding="utf-8").replace("[[in]]", place, 1)
    file = tmp_path / "mapping.toml"
    file.write_text(f'endpoint = "{endpoint}"\n' + text)
    out = tmp_path / "runs"
    with (
        ZenohBus(BusSetup(endpoint=endpoint), router=True),
        ZenohForeignBus(BusSetup(endpoint=endpoint)) as peer,
        started(out, *FLAGS, "--ros2", str(file)) as process,
    ):
        wait_for(lambda: bool(list(out.glob("*/run.json"))), "the run's record")
        car = Ros2Car(peer, listens_to=("foretwin/twin/**",))
        route = lanelet_route(line_deg, LocalFrame(origin))
        deadline_s = time.monotonic() + 90.0
        states = 0
        while states < 40:
            assert time.monotonic() < deadline_s
            peer.put("planning/mission_planning/route", route)
            assert car.drive_until(deadline_s=60.0) is not None
            states += 1
        process.send_signal(signal.SIGINT)
        screen, _ = process.communicate(timeout=60.0)
    folder = run_folder(out)
    assert folder is not None
    told = "\n".join(line["text"] for line in log_lines(folder)) + screen
    assert "route of the vehicle taken: " in told
    assert "cannot be used" not in told
    assert "left the given route" not in told
    assert json.loads((folder / "run.json").read_text())["route_source"] == "live"
