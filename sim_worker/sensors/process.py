"""The process of virtual sensors: `python -m foretwin.sim_worker.sensors.process --setup FILE`."""

from __future__ import annotations

import logging
from pathlib import Path

from foretwin.contracts.bus import Bus, Mailbox, Received
from foretwin.contracts.camera_image import CameraImage
from foretwin.contracts.drive import RoadUsers, VehicleState
from foretwin.contracts.point_cloud import PointCloud
from foretwin.contracts.process import ProcessLife, run_process
from foretwin.contracts.radar_list import RadarList
from foretwin.contracts.refusals import Refusals
from foretwin.contracts.sensed_motion import SensedFix, SensedImu
from foretwin.contracts.sensor_turns import SensorTurns, Turns, TurnsFile
from foretwin.contracts.setup import SensorsSetup
from foretwin.contracts.simulation import ActiveWorld
from foretwin.sim_worker.message_loop import passed_over_where_unfit
from foretwin.sim_worker.sensors.sensor_file import sensor_of
from foretwin.sim_worker.sensors.virtual_sensors import VirtualSensors
from foretwin.sim_worker.world_file import load_world

_DEPTH, _LIVE = 64, 32
"""States and real clouds of half a second: who falls behind longer has nothing to tell of them."""
_IDLE_S = 0.2
CHANNEL_OF = {
    PointCloud: "point_cloud",
    RadarList: "radar_list",
    CameraImage: "camera_image",
    SensedFix: "sensed_gnss",
    SensedImu: "sensed_imu",
}
"""By what a turn gave."""

log = logging.getLogger("sim_worker.sensors")


class SensorsProcess:
    """Feeds the sensors from messages; one that cannot be used is logged and passed over."""

    def __init__(self, setup: SensorsSetup, bus: Bus, *, refusals: Refusals | None = None) -> None:
        self._bus, self._run_id = bus, setup.run_id
        self._worlds_dir, self._lossless = Path(setup.worlds_dir), setup.bus.lossless
        self._refusals = Refusals() if refusals is None else refusals
        sensors = [(sensor_of(one.text, one.name), one.sees) for one in setup.sensors]
        self._sensors = VirtualSensors(sensors, seed=setup.seed)
        self._names = [one.name for one, _ in sensors]
        self._told_lost: set[int] = set()
        self._dropped, self._left = 0, False
        self.mailbox = Mailbox(_LIVE, when_full="block" if setup.bus.lossless else "drop_oldest")
        # Apart from the states, which must not push out the one word on the World.
        self.news = Mailbox(_DEPTH, when_full="block" if setup.bus.lossless else "drop_oldest")
        bus.subscribe("active_world", self.news, run=setup.run_id)
        for channel in ("virtual_traffic", "virtual_objects"):
            bus.subscribe(channel, self.news, run=setup.run_id)
        bus.subscribe("state", self.mailbox, vehicle=setup.vehicle_id)
        if any(one.sees == "real" for one in setup.sensors):
            bus.subscribe("real_cloud", self.mailbox, vehicle=setup.vehicle_id)

    def step(self, wait_s: float = _IDLE_S) -> None:
        """Take all that has come, or wait a moment for it, and measure what is due; never raises.

        Of turns that are over by now the newest is measured, the others are passed over. What has
        come meanwhile is taken after each of them. In lock step all are measured: states that come
        meanwhile wait, and the drive with them.
        """
        self._take_all(0.0 if self._left else wait_s)
        for _ in self._names:  # then who calls may look at its clock
            self._left = self._tell()
            if not self._left:
                break
            self._take_all(0.0)
        for place in self._sensors.lost.keys() - self._told_lost:
            self._told_lost.add(place)
            name, why = self._names[place], self._sensors.lost[place]
            log.warning("sensor %s gives nothing any more, the others go on: %s", name, why)

    def _tell(self) -> bool:
        """Measure one thing that is due and say it; returns whether there was any."""
        one = self._sensors.next_measured()
        if one is not None:
            self._bus.publish(CHANNEL_OF[type(one)], one, run=self._run_id)
        return one is not None

    def _take_all(self, wait_s: float) -> None:
        item = self.mailbox.take(wait_s)
        while (one := self.news.take()) is not None:
            self._handle(one)
        while item is not None:
            self._handle(item)
            while self._lossless and self._tell():
                pass
            item = self.mailbox.take()

    @property
    def turns(self) -> Turns:
        """What became of them so far, by sensor."""
        told, passed_over = self._sensors.told, self._sensors.passed_over
        return {
            name: SensorTurns(told=told[name], passed_over=passed_over[name])
            for name in told | passed_over
        }

    def _handle(self, item: object) -> None:
        if not isinstance(item, Received):
            return
        with passed_over_where_unfit(item, refusals=self._refusals, log=log):
            match item.message():
                case VehicleState() as state:
                    behind = self.mailbox.dropped > self._dropped
                    self._dropped = self.mailbox.dropped
                    self._sensors.take_state(state, behind=behind)
                case PointCloud() as real:
                    self._sensors.take_real(real)
                case RoadUsers() as users:
                    self._sensors.take_users(users)
                case ActiveWorld(world_id=world_id):
                    world = None if world_id is None else load_world(self._worlds_dir, world_id)
                    self._sensors.use_world(world)


def serve(setup: SensorsSetup, bus: Bus, life: ProcessLife) -> None:
    """Measure until the run is over."""
    process = SensorsProcess(setup, bus, refusals=life.refusals)
    file = TurnsFile(Path(setup.turns_dir))
    life.ready()
    while not life.over:
        process.step()
        file.look(process.turns)
    file.write(process.turns)
    log.info("turns: %s", process.turns)


if __name__ == "__main__":
    run_process(SensorsSetup, serve)
