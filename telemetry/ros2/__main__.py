"""The gateway to ROS 2 as a process: `python -m foretwin.telemetry.ros2 --setup FILE`."""

from __future__ import annotations

import logging
import math

from foretwin.contracts.bus import Bus
from foretwin.contracts.foreign_bus import ZenohForeignBus
from foretwin.contracts.process import ProcessLife, run_process
from foretwin.contracts.redialled_bus import RedialledBus
from foretwin.contracts.setup import BusSetup, Ros2Setup
from foretwin.telemetry.ros2.gateway import Gateway
from foretwin.telemetry.ros2.lot_guard import APART_M, LotGuard
from foretwin.telemetry.ros2.mapping import listening_only, parse_mapping
from foretwin.telemetry.ros_messages.parts import typestore

log = logging.getLogger("foretwin.telemetry.ros2")


def lot_guard(setup: Ros2Setup) -> LotGuard | None:
    """Return who watches the fence of the car's lot, None where it has none."""
    if setup.anchor is None or not setup.fence:
        return None
    car, scale = setup.vehicle, setup.anchor.scale
    ahead_m = 0.0 if car is None else car.length_m.value - car.rear_overhang_m.value
    aside_m = 0.0 if car is None else 0.5 * car.width_m.value
    return LotGuard(
        setup.fence,
        frame=setup.anchor.lot.frame,
        reach_m=math.hypot(ahead_m, aside_m) / scale,  # its file is in the World's size
        apart_m=APART_M / scale,
    )


def serve(setup: Ros2Setup, bus: Bus, life: ProcessLife) -> None:
    """Pass messages on until the run is over."""
    mapping = parse_mapping(setup.mapping, name=setup.mapping_name)
    if setup.listens_only:
        mapping = listening_only(mapping)
        log.info("listens to %s and sends it nothing", setup.vehicle_id)
    typestore()  # 0.15 s that no sample shall wait for
    # The run's own router knows us by the run's own certificates, the car's does not.
    theirs = setup.bus if mapping.endpoint is None else BusSetup(endpoint=mapping.endpoint)
    with ZenohForeignBus(theirs) as foreign:
        gateway = Gateway(
            mapping,
            bus=bus,
            foreign=foreign,
            run_id=setup.run_id,
            vehicle_id=setup.vehicle_id,
            drive_frame=setup.drive_frame,
            flag_on=setup.towards_vehicle,
            order_keys=setup.order_keys,
            car=setup.vehicle,
            anchor=setup.anchor,
            guard=lot_guard(setup),
            mounts=dict(setup.mounts),
            refusals=life.refusals,
        )
        life.ready()
        while not life.over:
            gateway.step()
        log.info("%s", gateway.report())


if __name__ == "__main__":
    run_process(Ros2Setup, serve, join=RedialledBus)
