"""What a camera sees: a body at the pixels of a pinhole, hidden behind a wall, in its colour."""

from __future__ import annotations

import io

import msgspec
import numpy as np
import pytest
from PIL import Image

from foretwin.contracts.arrays import Array
from foretwin.contracts.errors import UserError
from foretwin.contracts.frames import LocalPose
from foretwin.contracts.point_cloud import Mount
from foretwin.sim_worker.sensors.base_motion import BaseMotion, sensor_motion
from foretwin.sim_worker.sensors.camera import CameraView, CameraWorld
from foretwin.sim_worker.sensors.kinds import Camera
from foretwin.sim_worker.sensors.moving_boxes import NO_BODIES, MovingBoxes
from foretwin.sim_worker.sensors.offscreen import check_drawing
from foretwin.sim_worker.sensors.sensor_file import SensorFile, load_sensor
from foretwin.sim_worker.sensors.virtual_sensors import VirtualSensors
from tests.sim_worker.places import box, crossroads
from tests.sim_worker.sensors.test_lidar import HERE, bodies
from tests.sim_worker.sensors.test_virtual_sensors import driven, users

COVERS = ("foretwin.sim_worker.sensors.offscreen",)
MOUNT = Mount(forward_m=0.0, up_m=1.5)


@pytest.fixture(scope="module", autouse=True)
def _egl() -> None:
    try:
        check_drawing()
    except UserError as why:
        pytest.skip(str(why))


def camera(mount: Mount = MOUNT, **changes: object) -> SensorFile:
    small = Camera(rate_hz=10.0, width_px=320, height_px=200, field_of_view_deg=70.0)
    return SensorFile(
        name="small", source="drawn", mount=mount, camera=msgspec.structs.replace(small, **changes)
    )


def seen(
    who: MovingBoxes, sensor: SensorFile | None = None, motion: BaseMotion = HERE, house: float = 0
) -> CameraView:
    """At crossroads, with a wall across the view so far away."""
    walls = (box(house, 0.0, 0.5, 15.0),) if house else ()
    world = CameraWorld(crossroads(buildings=walls), camera() if sensor is None else sensor)
    try:
        return world.view(motion, who)
    finally:
        world.close()


def outline(view: CameraView, body: int = 0) -> list[int]:
    """First and last column, first and last row of a body."""
    rows, columns = np.nonzero(view.body == body)
    return [columns.min(), columns.max(), rows.min(), rows.max()]


def pixels_of(camera: Camera, places_m: Array) -> Array:
    """Places (N, 3) in a pinhole's own axes as columns and rows (N, 2) from its upper left edge."""
    x, y, z = places_m.T
    middle = np.array([camera.width_px, camera.height_px]) / 2.0
    return np.asarray(middle - camera.focal_px * np.stack([y / x, z / x], axis=1))


@pytest.mark.parametrize(
    ("mount", "motion"),
    [
        (MOUNT, HERE),
        (Mount(forward_m=1.5, left_m=0.5, up_m=1.2, yaw_deg=10.0, pitch_deg=3.0), HERE),
        (MOUNT, BaseMotion(LocalPose(-4.0, 1.0, 0.1), speed_mps=9.0)),
    ],
)
def test_a_red_box_is_at_the_pixels_that_a_pinhole_says(mount: Mount, motion: BaseMotion) -> None:
    """Its corners, seen from the camera, one by one; half a pixel is what drawing rounds by."""
    red = bodies((12.0, 2.0, 0.0, 2.0, 2.0, 2.0, 0.0))
    sensor = camera(mount)
    view = seen(red, sensor, motion)
    here = sensor_motion(motion, mount)
    corners = np.array([[x, y, z] for x in (11.0, 13.0) for y in (1.0, 3.0) for z in (0.0, 2.0)])
    pixels = pixels_of(sensor.measures(Camera), (corners - here.at_m) @ here.world_from_sensor)
    (left, top), (right, bottom) = pixels.min(axis=0), pixels.max(axis=0)

    assert outline(view) == pytest.approx([left, right - 1, top, bottom - 1], abs=1.0)
    is_red = view.rgb[..., 0].astype(int) - view.rgb[..., 1] > 50
    # Pixels at its edges are of both colours.
    assert (is_red != (view.body == 0)).sum() < 0.1 * is_red.sum()
    assert is_red.sum() > 500


def test_to_the_left_is_left_and_up_is_up() -> None:
    two = bodies((12.0, 3.0, 0.0, 1.0, 1.0, 1.0, 0.0), (12.0, -3.0, 0.0, 1.0, 1.0, 3.0, 0.0))
    view = seen(two)
    left, right = outline(view, 0), outline(view, 1)

    assert left[1] < 160 < right[0]
    assert left[2] > 100 > right[2]


def test_behind_a_wall_it_is_hidden_and_before_it_not() -> None:
    red = bodies((12.0, 0.0, 0.0, 2.0, 2.0, 2.0, 0.0))
    hidden, before = seen(red, house=8.0), seen(red, house=20.0)

    assert not (hidden.body == 0).any()
    assert (before.body == 0).sum() > 500
    assert hidden.rgb[100, 160, 0] - hidden.rgb[100, 160, 1].astype(int) < 40


def test_a_pixel_at_an_edge_is_as_far_away_as_the_body_that_it_shows() -> None:
    """A turned box before the sky, whose near edge is 10 m off and whose far ones are 14 m off."""
    post = bodies((12.0, 0.0, 0.785, 2.83, 2.83, 3.0, 0.0))
    drawn = CameraWorld(None, camera(Mount(forward_m=0.0, up_m=1.5, roll_deg=7.0)))
    try:
        view = drawn.view(HERE, post)
    finally:
        drawn.close()

    assert (np.isinf(view.depth_m) == (view.body == -2)).all()
    assert (view.depth_m[view.body == 0] < 14.01).all()
    rows, columns = np.nonzero(view.body == 0)
    focal_px = camera().measures(Camera).focal_px
    aside, up = (columns + 0.5 - 160.0) / focal_px, (rows + 0.5 - 100.0) / focal_px
    # Of a place at depth d seen from 1.5 m up and 7 degrees askew: its y, and the side it lies on.
    turned = np.abs(np.cos(np.radians(7.0)) * aside - np.sin(np.radians(7.0)) * up)
    assert view.depth_m[rows, columns] == pytest.approx(10.0 / (1.0 - turned), abs=0.01)


def test_depths_are_along_the_view_and_nothing_is_far() -> None:
    view = seen(bodies((12.0, 0.0, 0.0, 2.0, 6.0, 2.0, 0.0)), house=40.0)

    assert view.depth_m[view.body == 0] == pytest.approx(11.0, abs=0.01)
    # Below the horizon the road, which lies 1 cm up: f y / d rows.
    focal_px = camera().measures(Camera).focal_px
    assert view.depth_m[190, 160] == pytest.approx(1.49 * focal_px / 90.5, rel=0.01)
    assert view.depth_m[85, 160] == pytest.approx(39.5, abs=0.05)
    assert np.isinf(view.depth_m[0, 160])
    assert view.body[0, 160] == -2
    assert view.body[190, 160] == -1
    assert tuple(view.rgb[0, 160]) == (150, 180, 210)


def test_who_moves_is_drawn_anew_and_colours_alone_are_the_same_picture() -> None:
    world = CameraWorld(crossroads(), camera())
    try:
        first, after = (
            world.view(HERE, bodies((x, 0.0, 0.0, 2.0, 2.0, 2.0, 0.0))) for x in (12.0, 20.0)
        )
        row = [(10.0 + 0.1 * k, -5.0, 0.0, 0.5, 0.5, 1.0, 0.0) for k in range(299)]
        many = bodies(*row, (10.0, 3.0, 0.0, 1.0, 1.0, 1.0, 0.0))
        crowd, alone = world.view(HERE, many), world.picture(HERE, many)
        empty = world.view(HERE, NO_BODIES)
    finally:
        world.close()

    assert (first.body == 0).sum() > 2 * (after.body == 0).sum() > 100
    # Numbers beyond one byte too: the last stands to the left, the others to the right.
    assert set(np.unique(crowd.body[:, :160])) == {-2, -1, 299}
    assert set(np.unique(crowd.body[:, 160:])) <= {-2, -1, *range(299)}
    assert np.array_equal(crowd.rgb, alone)
    assert empty.body.max() == -1


def test_without_a_world_there_are_road_users_alone() -> None:
    world = CameraWorld(None, camera())
    try:
        view = world.view(HERE, bodies((12.0, 0.0, 0.0, 2.0, 2.0, 2.0, 0.0)))
    finally:
        world.close()
    assert set(np.unique(view.body)) == {-2, 0}


def test_without_egl_one_line_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("__EGL_VENDOR_LIBRARY_FILENAMES", "/nowhere.json")
    with pytest.raises(UserError, match=r"^cameras need EGL: .*Debian.*EGL") as raised:
        check_drawing()
    assert "\n" not in str(raised.value)


def test_the_bundled_camera_is_what_it_says() -> None:
    vga = load_sensor("vga_camera").measures(Camera)
    assert (vga.width_px, vga.height_px, vga.rate_hz) == (640, 480, 10.0)
    assert vga.focal_px == pytest.approx(320.0 / np.tan(np.radians(35.0)))


def test_a_picture_is_told_when_its_turn_is_over_and_of_the_world_in_force() -> None:
    sensors = VirtualSensors([(camera(), "world"), (camera(), "users")])
    sensors.take_users(users(0, "van"))
    alone = driven(sensors, 100)
    sensors.use_world(crossroads(buildings=(box(8.0, 0.0, 0.5, 15.0),)))
    sensors.take_users(users(100, "van"))
    both = driven(sensors, 200, from_ms=120)
    sensors.close()

    assert [one.stamp_ns for one in alone] == [0]
    assert [one.stamp_ns for one in both] == [100_000_000] * 2
    told = both[0]
    assert (told.sensor, told.width_px, told.height_px, told.mount) == ("small", 320, 200, MOUNT)
    hidden, seen_alone = (np.asarray(Image.open(io.BytesIO(one.jpeg))) for one in both)
    assert hidden.shape == (200, 320, 3)
    # A van is nearly white, and behind the wall.
    assert int(seen_alone[110, 160].min()) > int(hidden[110, 160].max()) - 30
    assert np.abs(seen_alone[5, 160].astype(int) - (150, 180, 210)).max() < 12
    assert np.abs(hidden[5, 160].astype(int) - (150, 180, 210)).max() > 30
