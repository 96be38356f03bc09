"""Sensors of a car that drives: states and road users in, what is measured out, turn by turn."""

from __future__ import annotations

from collections import Counter, deque
from collections.abc import Sequence
from typing import NamedTuple

import msgspec
import numpy as np

from foretwin.contracts.camera_image import CameraImage
from foretwin.contracts.drive import RoadUser, RoadUsers, VehicleState
from foretwin.contracts.frames import LocalFrame, local_pose
from foretwin.contracts.point_cloud import PointCloud
from foretwin.contracts.radar_list import RadarList
from foretwin.contracts.sensed_motion import SensedFix, SensedImu
from foretwin.contracts.setup import SensorSees
from foretwin.contracts.too_old import USERS_FOR_NS
from foretwin.contracts.world import World
from foretwin.sim_worker.sensors.base_motion import BaseMotion, moved
from foretwin.sim_worker.sensors.camera import CameraWorld, message_of
from foretwin.sim_worker.sensors.cloud_merge import merge
from foretwin.sim_worker.sensors.kinds import Camera, Gnss, Imu, Lidar
from foretwin.sim_worker.sensors.lidar import LidarScan, scan
from foretwin.sim_worker.sensors.motion_sensors import MotionSensor
from foretwin.sim_worker.sensors.moving_boxes import MovingBoxes, boxes_of
from foretwin.sim_worker.sensors.offscreen import DrawingError
from foretwin.sim_worker.sensors.radar import detect
from foretwin.sim_worker.sensors.ray_world import RayWorld
from foretwin.sim_worker.sensors.sensor_file import SensorFile

_LATE_TURNS = 3
"""Who hears nothing for longer was not driving: turns of that time are not missed."""
_LATELY = 20
"""Turns of a sensor by which it is seen who comes too short; chosen."""
_STATES = 32
"""So many are kept, to know where the car was as a real turn began: over half a second."""


class _LastWord(NamedTuple):
    stamp_ns: int
    user: RoadUser


class _Turn(NamedTuple):
    """One that began: the first state in it, and who was known to be there."""

    number: int
    begun_ns: int
    state: VehicleState
    said: tuple[_LastWord, ...]


Measured = PointCloud | RadarList | CameraImage | SensedFix | SensedImu
"""What a turn gives: of a lidar, a radar, a camera, a receiver, an inertial sensor."""


class VirtualSensors:
    """Measures turn after turn; a turn is told when it is over, with what was known as it began.

    Turns begin at whole periods of the car's clock, whenever the first state came: the same input
    and seed give the same clouds. Who is asked late measures the newest turn alone and counts the
    others; receivers and inertial sensors measure them all. Where there is no time for all sensors
    the one comes first that told the least share of its last turns. A sensor that sees the World
    measures nothing while there is none. One with a delay is asked for its turns so much later. A
    camera that cannot be drawn any more is left out from then on.
    """

    def __init__(self, sensors: Sequence[tuple[SensorFile, SensorSees]], *, seed: int = 0) -> None:
        self._sensors, self._seed = tuple(sensors), seed
        self._turns: dict[int, _Turn] = {}
        self._over: dict[int, deque[_Turn]] = {}
        self._due: dict[int, list[_Turn]] = {}
        self._of_motion = {
            place: MotionSensor(sensor, seed=(self._seed + sensor.seed, place))
            for place, (sensor, _) in enumerate(self._sensors)
            if isinstance(sensor.kind, Gnss | Imu)
        }
        self._real: dict[int, PointCloud] = {}
        self._said: dict[str, _LastWord] = {}
        self._states: deque[VehicleState] = deque(maxlen=_STATES)
        self._world: World | None = None
        self._rays: RayWorld | None = None
        self._no_world = RayWorld()
        self._pictures: dict[int, CameraWorld] = {}
        self._lately = [deque[bool](maxlen=_LATELY) for _ in sensors]
        """Of each sensor, which of its last turns were told."""
        self.passed_over: Counter[str] = Counter()
        """By sensor, turns of which nothing was told."""
        self.told: Counter[str] = Counter()
        """By sensor."""
        self.lost: dict[int, str] = {}
        """By their place in the list, sensors that give nothing any more, and why."""

    def use_world(self, world: World | None) -> None:
        """Look into another World from now on, or into none."""
        self._world, self._rays = world, None if world is None else RayWorld(world)
        self.close()

    def close(self) -> None:
        """Give back what cameras draw with; they draw on all the same."""
        for place in list(self._pictures):
            self._pictures.pop(place).close()

    def take_users(self, users: RoadUsers) -> None:
        """Keep the last word on each road user, whoever says it."""
        for user in users.users:
            known = self._said.get(user.user_id)
            if known is None or users.stamp_ns >= known.stamp_ns:
                self._said[user.user_id] = _LastWord(users.stamp_ns, user)

    def take_state(self, state: VehicleState, *, behind: bool = False) -> None:
        """Take where the car is: turns that are over by then are due.

        `behind`: states before this one were there and could not be taken.
        """
        self._said = {
            name: one
            for name, one in self._said.items()
            if abs(state.stamp_ns - one.stamp_ns) <= USERS_FOR_NS
        }
        self._states.append(state)
        for place, (sensor, sees) in enumerate(self._sensors):
            if sees != "real":
                self._take_turn(place, sensor, state, behind=behind)

    def _take_turn(
        self, place: int, sensor: SensorFile, state: VehicleState, *, behind: bool
    ) -> None:
        """Begin a turn where it is time to, and see which of those before are to be told."""
        period_ns = round(1e9 / sensor.kind.rate_hz)
        number = state.stamp_ns // period_ns
        turn, over = self._turns.get(place), self._over.setdefault(place, deque())
        if turn is None or turn.number != number:
            said = tuple(self._said.values())
            self._turns[place] = _Turn(number, number * period_ns, state, said)
            missed = 0 if turn is None else number - turn.number - 1
            if turn is not None and (0 <= missed < _LATE_TURNS or (behind and missed >= 0)):
                self._passed_over(place, missed)
                over.append(turn)
            else:
                self._due.pop(place, None)
                over.clear()
        told_ns = state.stamp_ns - period_ns - round(sensor.delay_s * 1e9)
        while over and over[0].begun_ns <= told_ns:
            due = self._due.setdefault(place, [])
            if place not in self._of_motion:
                self._passed_over(place, len(due))
                due.clear()
            due.append(over.popleft())

    def _passed_over(self, place: int, turns: int) -> None:
        self.passed_over[self._sensors[place][0].name] += turns
        self._lately[place].extend([False] * min(turns, _LATELY))

    def measured(self) -> list[Measured]:
        """Return all that is due."""
        return list(iter(self.next_measured, None))

    def next_measured(self) -> Measured | None:
        """Return one thing that is due, None where nothing is."""
        while self._due or self._real:
            place = min(self._due.keys() | self._real.keys(), key=self._share_told)
            if (found := self._measured_at(place)) is not None:
                self.told[found.sensor] += 1
                self._lately[place].append(True)
                return found
        return None

    def _share_told(self, place: int) -> tuple[float, int]:
        lately = self._lately[place]
        return (sum(lately) / len(lately) if lately else 1.0), place

    def _measured_at(self, place: int) -> Measured | None:
        """Take the first turn that is due of a sensor, and measure it where that can be done."""
        if (cloud := self._real.pop(place, None)) is not None:
            return self._merged(place, cloud)
        turn = self._due[place].pop(0)
        if not self._due[place]:
            del self._due[place]
        rays = self._rays if self._sensors[place][1] == "world" else self._no_world
        if not turn.state.yaw_valid:
            return None
        if place in self._of_motion:
            return self._of_motion[place].sample(turn.state, at_ns=turn.begun_ns)
        if rays is None:
            return None
        if place not in self.lost:
            try:
                return self._measure(rays, place, turn)
            except DrawingError as why:
                self.lost[place] = str(why)
        self._passed_over(place, 1)
        return None

    def take_real(self, cloud: PointCloud) -> None:
        """Take a turn of the car's own sensor, into which the road users are to be put."""
        for place, (sensor, sees) in enumerate(self._sensors):
            if sees == "real" and sensor.name == cloud.sensor:
                self._passed_over(place, int(place in self._real))
                self._real[place] = cloud

    def _merged(self, place: int, cloud: PointCloud) -> PointCloud:
        """As it came where nobody is, or it is not known where the car was."""

        def away_ns(state: VehicleState) -> int:
            return abs(state.stamp_ns - cloud.stamp_ns)

        state = min(self._states, key=away_ns, default=None)
        if not self._said or state is None or not state.yaw_valid or away_ns(state) > USERS_FOR_NS:
            return cloud
        turn = _Turn(0, cloud.stamp_ns, state, tuple(self._said.values()))
        virtual = self._scan(self._no_world, place, turn)
        return msgspec.structs.replace(cloud, points=merge(cloud.points, virtual))

    def _measure(self, rays: RayWorld, place: int, turn: _Turn) -> Measured:
        sensor = self._sensors[place][0]
        if isinstance(sensor.kind, Lidar):
            points = self._scan(rays, place, turn).points
            return PointCloud(stamp_ns=turn.begun_ns, points=points, sensor=sensor.name)
        motion, boxes, seed = self._begun(place, turn)
        if isinstance(sensor.kind, Camera):
            rgb = self._camera_world(place).picture(motion, boxes)
            return message_of(rgb, sensor, stamp_ns=turn.begun_ns)
        returns = detect(rays, sensor, motion, boxes, seed=seed).returns
        return RadarList(
            stamp_ns=turn.begun_ns, returns=returns, sensor=sensor.name, mount=sensor.mount
        )

    def _camera_world(self, place: int) -> CameraWorld:
        """Made where pictures are drawn, and so in their thread."""
        if place not in self._pictures:
            sensor, sees = self._sensors[place]
            self._pictures[place] = CameraWorld(self._world if sees == "world" else None, sensor)
        return self._pictures[place]

    def _scan(self, rays: RayWorld, place: int, turn: _Turn) -> LidarScan:
        motion, boxes, seed = self._begun(place, turn)
        return scan(rays, self._sensors[place][0], motion, boxes, seed=seed)

    def _begun(self, place: int, turn: _Turn) -> tuple[BaseMotion, MovingBoxes, tuple[int, ...]]:
        """Return how the car and all others were as a turn began, and the seed of its noise."""
        state = turn.state
        frame = LocalFrame(state.position) if self._world is None else self._world.frame
        pose = local_pose(frame, state.position, state.yaw_rad)
        motion = BaseMotion(pose, state.speed_mps, state.yaw_rate_radps)
        motion = moved(motion, (turn.begun_ns - state.stamp_ns) * 1e-9)
        seed = self._seed + self._sensors[place][0].seed, place, abs(turn.begun_ns)
        return motion, _boxes_at(frame, turn), seed


def _boxes_at(frame: LocalFrame, turn: _Turn) -> MovingBoxes:
    """Return the road users where they are as a turn begins: they have driven straight on."""
    boxes = boxes_of(frame, [one.user for one in turn.said])
    ages_s = np.array([turn.begun_ns - one.stamp_ns for one in turn.said]) * 1e-9
    way_m = (boxes.speed_mps * ages_s)[:, None]
    along = np.stack([np.cos(boxes.yaw_rad), np.sin(boxes.yaw_rad)], axis=1)
    return boxes._replace(xy_m=boxes.xy_m + way_m * along)
