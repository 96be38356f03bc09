"""A road user that does not exist, for the car's own driving stack: copy it and put yours in.

    foretwin drive --map town.osm --source live --ros2 my.toml --config fixed.toml --towards-vehicle
    python examples/virtual_road_user.py --lat 52.51 --lon 13.39

A pedestrian walks to and fro at that place, 10 times a second, until Ctrl-C; docs/ros2.md says what
my.toml needs so that it goes out.
"""

from __future__ import annotations

import argparse
import contextlib
import math
import sys
from pathlib import Path

import numpy as np

from foretwin.bus import (
    Alive,
    Bus,
    BusSetup,
    GeoPoint,
    LocalFrame,
    Mailbox,
    Received,
    RoadUser,
    RoadUsers,
    ZenohBus,
    alive_key,
    geo_from_local,
    newest_running,
    run_of_alive_key,
)

PERIOD_NS = 100_000_000
WAY_M, SPEED_MPS = 6.0, 1.4


def pedestrian(place: GeoPoint, time_s: float) -> RoadUser:
    """Return one who walks `WAY_M` north and back again."""
    driven = SPEED_MPS * time_s % (2.0 * WAY_M)
    north_m = min(driven, 2.0 * WAY_M - driven)
    lat, lon = geo_from_local(LocalFrame(place), np.array([0.0, north_m])).tolist()
    return RoadUser(
        user_id="walker-1",
        kind="pedestrian",
        virtual=True,
        position=GeoPoint(lat, lon),
        yaw_rad=math.copysign(math.pi / 2.0, WAY_M - driven),
        speed_mps=SPEED_MPS,
        length_m=0.5,
        width_m=0.6,
    )


def serve(bus: Bus, place: GeoPoint) -> None:
    """Say where the road user is at each tenth of the vehicle's own time, in every run."""
    inbox = Mailbox(64)
    bus.watch_alive(alive_key(run="*", process="orchestrator"), inbox)
    bus.subscribe("state", inbox, vehicle="*")
    print("ready", flush=True)
    run_id: str | None = None
    begun_ns = said_ns = 0
    while True:
        item = inbox.take(1.0)
        if isinstance(item, Alive):
            run_id = run_of_alive_key(item.key) if item.up else None
        elif isinstance(item, Received) and run_id is not None:
            stamp_ns = item.message().stamp_ns
            begun_ns = begun_ns or stamp_ns
            if abs(stamp_ns - said_ns) >= PERIOD_NS:
                said_ns = stamp_ns
                users = (pedestrian(place, (stamp_ns - begun_ns) * 1e-9),)
                message = RoadUsers(stamp_ns=stamp_ns, users=users)
                bus.publish("virtual_objects", message, run=run_id)


def main() -> int:
    """Join the bus of a drive and serve until Ctrl-C."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, default=Path("runs"), help="folder of the runs")
    parser.add_argument("--endpoint", help="where a run listens that asks nobody who it is")
    parser.add_argument("--lat", type=float, required=True, help="degrees")
    parser.add_argument("--lon", type=float, required=True, help="degrees")
    given = parser.parse_args()
    if given.endpoint is None:
        setup = newest_running(given.out).bus("operator")
    else:
        setup = BusSetup(endpoint=given.endpoint)
    with contextlib.suppress(KeyboardInterrupt), ZenohBus(setup) as bus:
        serve(bus, GeoPoint(given.lat, given.lon))
    return 0


if __name__ == "__main__":
    sys.exit(main())
