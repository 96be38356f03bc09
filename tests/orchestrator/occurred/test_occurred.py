"""What occurred in a run, read from the folder that a drive leaves."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from foretwin.contracts.drive import GnssFix, RoadUser, RoadUsers, VehicleState
from foretwin.contracts.frames import GeoPoint, LocalFrame, geo_from_local
from foretwin.contracts.segments import DRIVE_FILE
from foretwin.orchestrator.occurred.drive_read import motion_in, read_run
from foretwin.orchestrator.occurred.occurred import occurred_in
from foretwin.telemetry.logs.write_mcap import create
from tests.orchestrator.recorded_runs import write_run
from tests.sim_worker.scenarios.worlds import cross

COVERS = ("foretwin.orchestrator.occurred.drive_read",)
SPEED_MPS, START_X_M, START_NS = 8.0, -70.0, 1_000_000_000_000


def _crosses(name: str, second: float, *, virtual: bool = False) -> RoadUser:
    """From the right, past the car's nose or tail."""
    xy = np.array([1.6, -1.5 + 8.0 * (second - 9.9)])
    lat, lon = geo_from_local(cross().frame, xy)
    return RoadUser(
        user_id=name,
        kind="car",
        position=GeoPoint(float(lat), float(lon)),
        yaw_rad=np.pi / 2,
        speed_mps=8.0,
        length_m=4.5,
        width_m=1.8,
        virtual=virtual,
    )


def _run(folder: Path, *names: str, virtual: bool = False) -> Path:
    tenths = np.arange(180)
    xy = np.column_stack([START_X_M + SPEED_MPS * tenths / 10.0, np.full(180, -1.5)])
    objects = [
        RoadUsers(
            stamp_ns=START_NS + tenth * 100_000_000,
            users=tuple(_crosses(name, tenth / 10.0, virtual=virtual) for name in names),
        )
        for tenth in tenths.tolist()
    ]
    return write_run(
        folder,
        cross(),
        rounds_s=range(1, 18),
        speed_mps=SPEED_MPS,
        stamps_ns=(START_NS + tenths * 100_000_000).tolist(),
        lat_lon_deg=geo_from_local(cross().frame, xy),
        objects=objects if names else (),
    )


def test_a_run_tells_of_its_junction_and_of_whom_the_car_met(tmp_path: Path) -> None:
    found = occurred_in(_run(tmp_path, "b"))

    assert [(row.kind, row.other_id) for row in found.scenarios] == [
        ("crossing_from_right", "b"),
        ("through_straight", ""),
    ]
    assert {row.junction_id for row in found.scenarios} == {cross().intersection.id}
    assert found.sees_others


def test_virtual_road_users_are_nobody_that_the_car_met(tmp_path: Path) -> None:
    found = occurred_in(_run(tmp_path, "b", virtual=True))

    assert [row.kind for row in found.scenarios] == ["through_straight"]


def test_a_car_that_tells_of_nobody_is_said_to(tmp_path: Path) -> None:
    found = occurred_in(str(_run(tmp_path)))

    assert not found.sees_others
    assert "told of no road users" in found.notes[0]


def test_a_recording_whose_first_parts_are_gone_is_read_in_all_that_are_left(
    tmp_path: Path,
) -> None:
    run = _run(tmp_path, "b")
    whole = read_run(run)
    (run / DRIVE_FILE).unlink()
    halves = whole.states[:80], whole.states[80:]
    for name, states in zip(("drive-002.mcap", "drive-003.mcap"), halves, strict=True):
        with create(run / name, info=whole.info) as writer:
            writer.add("gnss", GnssFix(stamp_ns=START_NS, position=states[0].position))
            for state in states:
                writer.add("state", state)

    assert read_run(run).states == whole.states


def test_a_folder_of_no_run_is_refused(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError, match=r"no drive\.mcap"):
        occurred_in(tmp_path)


def test_what_the_map_moved_a_position_by_is_no_motion() -> None:
    frame = LocalFrame(GeoPoint(52.5, 13.4))
    states = [
        VehicleState(
            vehicle_id="ego", stamp_ns=n * 100_000_000, position=GeoPoint(52.5, 13.4), yaw_rad=0.0,
            speed_mps=0.0, yaw_rate_radps=0.0, accel_mps2=0.0,
            map_shift_m=None if n < 5 else (3.0, -2.0),
        )
        for n in range(10)
    ]  # fmt: skip

    motion = motion_in(frame, states)

    assert motion.xy_m[0] == pytest.approx([0.0, 0.0], abs=0.01)
    assert motion.xy_m[-1] == pytest.approx([-3.0, 2.0], abs=0.01)
