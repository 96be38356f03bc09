"""What a camera sees of a World and its road users: colours, distances, and whom."""

from __future__ import annotations

import contextlib
import io
from typing import Any, NamedTuple

import mujoco
import numpy as np
import numpy.typing as npt
from PIL import Image

from foretwin.contracts.arrays import Array32, Indices
from foretwin.contracts.camera_image import CameraImage
from foretwin.contracts.world import World
from foretwin.sim_worker.sensors.base_motion import BaseMotion, sensor_motion
from foretwin.sim_worker.sensors.kinds import Camera
from foretwin.sim_worker.sensors.moving_boxes import ModelAmongBoxes, MovingBoxes
from foretwin.sim_worker.sensors.offscreen import DrawingError, drawing, drawing_context
from foretwin.sim_worker.sensors.sensor_file import SensorFile
from foretwin.world_gen.export.mjcf import world_spec

_NEAR_M, _FAR_M = 0.1, 2000.0
"""Nothing nearer or farther is drawn."""
_SKY = np.array([150, 180, 210], dtype=np.uint8)
_AMBIENT = 0.6
"""Light from everywhere; the rest is the sun's, which the World's model has."""
_SPARE_GEOMS = 64

Picture = npt.NDArray[np.uint8]


class CameraView(NamedTuple):
    """One picture of height H and width W, its first row the upper one.

    `rgb` (H, W, 3); `depth_m` (H, W) along the axis of view, infinite where nothing is; `body`
    (H, W): which of the bodies, -1: none, and -2 where nothing is at all.
    """

    sensor: SensorFile
    rgb: Picture
    depth_m: Array32
    body: Indices


class CameraWorld:
    """Draws a World, or nothing but road users, for one camera; of one thread, that which made it.

    All of it raises DrawingError where nothing can be drawn, or not any more. A World of pictures
    is flat, as that of rays.
    """

    def __init__(self, world: World | None, sensor: SensorFile) -> None:
        self._world, self.sensor = world, sensor
        self._camera = sensor.measures(Camera)
        size = self._camera.width_px, self._camera.height_px
        self._gl: Any = drawing_context(*size)
        self._among = ModelAmongBoxes(self._standing)
        self._model: mujoco.MjModel | None = None
        self._rect = mujoco.MjrRect(0, 0, *size)

    def close(self) -> None:
        """Give back what the driver holds."""
        with contextlib.suppress(DrawingError), drawing():
            self._gl.free()

    def view(self, motion: BaseMotion, bodies: MovingBoxes) -> CameraView:
        """Return what is seen at the instant of `motion` and `bodies`."""
        with drawing():
            geoms = self._look(motion, bodies)
            rgb = self._drawn_now()
            flags = self._scene.flags
            flags[mujoco.mjtRndFlag.mjRND_SEGMENT] = flags[mujoco.mjtRndFlag.mjRND_IDCOLOR] = 1
            # Segments are drawn without smooth edges: of the colours, a pixel at an edge has the
            # depth of whatever lies anywhere in it.
            numbers, far = self._read()
            flags[mujoco.mjtRndFlag.mjRND_SEGMENT] = flags[mujoco.mjtRndFlag.mjRND_IDCOLOR] = 0
        return CameraView(self.sensor, rgb, _depths_m(far), self._bodies(numbers, geoms))

    def picture(self, motion: BaseMotion, bodies: MovingBoxes) -> Picture:
        """Return the colours alone (H, W, 3): half the work."""
        with drawing():
            self._look(motion, bodies)
            return self._drawn_now()

    def _standing(self) -> mujoco.MjSpec:
        spec = mujoco.MjSpec() if self._world is None else world_spec(self._world)
        if self._world is None:
            spec.worldbody.add_light(pos=[0, 0, 200], dir=[0.3, 0.2, -1], castshadow=False)
        spec.visual.global_.offwidth = self._camera.width_px
        spec.visual.global_.offheight = self._camera.height_px
        head = spec.visual.headlight
        head.ambient, head.diffuse, head.specular = [_AMBIENT] * 3, [0.0] * 3, [0.0] * 3
        return spec

    def _look(self, motion: BaseMotion, bodies: MovingBoxes) -> slice:
        """Look from the sensor, by its own pinhole instead of one of MuJoCo's cameras; return which
        geoms the bodies are."""
        self._gl.make_current()
        geoms = self._among.set(bodies)
        self._among.place(0.0)
        model = self._among.model
        if self._model is not model:
            self._model = model
            self._scene = mujoco.MjvScene(model, maxgeom=int(model.ngeom) + _SPARE_GEOMS)
            self._target = mujoco.MjrContext(model, mujoco.mjtFontScale.mjFONTSCALE_100.value)
            mujoco.mjr_setBuffer(mujoco.mjtFramebuffer.mjFB_OFFSCREEN.value, self._target)
        mujoco.mjv_updateScene(
            model, self._among.data, mujoco.MjvOption(), None, mujoco.MjvCamera(),
            mujoco.mjtCatBit.mjCAT_ALL.value, self._scene,
        )  # fmt: skip
        here = sensor_motion(motion, self.sensor.mount)
        per_px = _NEAR_M / self._camera.focal_px / 2.0
        for eye in self._scene.camera:
            eye.pos[:] = here.at_m
            eye.forward[:], eye.up[:] = here.world_from_sensor[:, 0], here.world_from_sensor[:, 2]
            eye.frustum_near, eye.frustum_far = _NEAR_M, _FAR_M
            eye.frustum_center, eye.orthographic = 0.0, 0
            eye.frustum_width = per_px * self._camera.width_px
            eye.frustum_top = per_px * self._camera.height_px
            eye.frustum_bottom = -eye.frustum_top
        return geoms

    def _drawn_now(self) -> Picture:
        """Return the picture, with a sky."""
        rgb, far = self._read()
        rgb[np.isinf(_depths_m(far))] = _SKY
        return rgb

    def _read(self) -> tuple[Picture, Array32]:
        shape = self._camera.height_px, self._camera.width_px
        rgb, far = np.empty((*shape, 3), np.uint8), np.empty(shape, np.float32)
        mujoco.mjr_render(self._rect, self._scene, self._target)
        mujoco.mjr_readPixels(rgb, far, self._rect, self._target)
        return rgb[::-1].copy(), far[::-1].copy()

    def _bodies(self, numbers: Picture, geoms: slice) -> Indices:
        """Return (H, W) whom the numbers of a picture of segments mean."""
        found = numbers.astype(np.int64) @ np.array([1, 256, 65536]) - 1
        whose = np.full(self._scene.ngeom + 1, -2)  # the last: what is no segment
        for one in self._scene.geoms[: self._scene.ngeom]:
            within = geoms.start <= one.objid < geoms.stop
            whose[one.segid] = one.objid - geoms.start if within else -1
        return np.asarray(whose[np.where(found < self._scene.ngeom, found, -1)])


def _depths_m(far: Array32) -> Array32:
    """Return the distances along the view, infinite where the sky is."""
    depth_m = _NEAR_M * _FAR_M / (_FAR_M - far * np.float32(_FAR_M - _NEAR_M))
    depth_m[depth_m >= 0.999 * _FAR_M] = np.inf
    return depth_m


def message_of(rgb: Picture, sensor: SensorFile, *, stamp_ns: int) -> CameraImage:
    """Return a picture (H, W, 3) of a camera as it is told: as JPEG."""
    camera = sensor.measures(Camera)
    file = io.BytesIO()
    Image.fromarray(rgb).save(file, "JPEG", quality=camera.jpeg_quality)
    return CameraImage(
        stamp_ns=stamp_ns,
        jpeg=file.getvalue(),
        width_px=camera.width_px,
        height_px=camera.height_px,
        focal_px=camera.focal_px,
        sensor=sensor.name,
        mount=sensor.mount,
    )
