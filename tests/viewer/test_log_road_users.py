"""Road users on screen: boxes where they are, at 10 Hz, and none once they are gone."""

from __future__ import annotations

import math

import msgspec
import numpy as np
import pytest
import rerun as rr

from foretwin.contracts.drive import RoadUser, RoadUsers
from foretwin.contracts.frames import GeoPoint, LocalFrame, geo_pose
from foretwin.contracts.too_old import USERS_FOR_NS
from foretwin.viewer.colours import DETECTED, VIRTUAL
from foretwin.viewer.log_road_users import DETECTED_PATH, VIRTUAL_PATH, RoadUsersLog
from foretwin.viewer.monitor import Monitor
from tests.viewer import scene

FRAME = LocalFrame(GeoPoint(52.5, 13.4))


def users(*places: tuple[float, float, float]) -> RoadUsers:
    found = []
    for x, y, yaw in places:
        pose = geo_pose(FRAME, x, y, yaw)
        found.append(
            RoadUser(
                user_id=f"{x}",
                kind="van",
                position=pose.position,
                yaw_rad=pose.yaw_rad,
                speed_mps=1.0,
                length_m=6.0,
                width_m=2.0,
                virtual=True,
            )
        )
    return RoadUsers(stamp_ns=0, users=tuple(found))


def cells(batch: object) -> list[list[float]]:
    return batch.as_arrow_array().to_pylist()  # type: ignore[attr-defined,no-any-return]


def test_boxes_stand_where_they_are() -> None:
    log = RoadUsersLog(FRAME, VIRTUAL_PATH, VIRTUAL)
    (row,) = log.rows(users((200.0, -30.0, 0.0), (0.0, 50.0, math.pi / 2)), 0)
    boxes = row.components
    assert row.path == VIRTUAL_PATH
    assert isinstance(boxes, rr.Boxes3D)
    assert np.array(cells(boxes.centers))[:, :2] == pytest.approx(
        np.array([[200.0, -30.0], [0.0, 50.0]]), abs=1e-3
    )
    assert np.array(cells(boxes.half_sizes)) == pytest.approx(np.array([[3.0, 1.0, 1.3]] * 2))
    assert np.array(cells(boxes.quaternions))[:, 2] == pytest.approx(
        [0.0, math.sqrt(0.5)], abs=1e-5
    )


def test_they_are_drawn_ten_times_a_second_and_taken_away_at_once() -> None:
    log = RoadUsersLog(FRAME, VIRTUAL_PATH, VIRTUAL)
    drawn = [bool(log.rows(users((1.0, 2.0, 0.0)), k * 50_000_000)) for k in range(6)]
    assert drawn == [True, False] * 3
    (row,) = log.rows(users(), 260_000_000)
    assert isinstance(row.components, rr.Clear)
    assert log.rows(users((1.0, 2.0, 0.0)), 270_000_000)


def test_who_is_detected_is_shown_until_nothing_was_said_of_it_for_half_a_second() -> None:
    monitor = Monitor(
        drive_frame=scene.DRIVE_FRAME,
        find_start=lambda _: scene.START_NS,
        title="",
        load_world=lambda _: scene.junction(),
    )
    seen = msgspec.structs.replace(users((1.0, 2.0, 0.0)), stamp_ns=scene.START_NS)
    (row,) = monitor.handle("objects", seen)
    boxes = row.components
    assert row.path == DETECTED_PATH
    assert isinstance(boxes, rr.Boxes3D)
    assert cells(boxes.colors) == cells(rr.components.ColorBatch([DETECTED]))

    def taken_away(after_ns: int) -> bool:
        rows = monitor.handle("state", scene.state_at(after_ns * 1e-9))
        return any(r.path == DETECTED_PATH and isinstance(r.components, rr.Clear) for r in rows)

    late = [USERS_FOR_NS, USERS_FOR_NS + 1_000_000, USERS_FOR_NS + 2_000_000]
    assert [taken_away(after_ns) for after_ns in late] == [False, True, False]
