"""Writes the logs of this folder with Cap'n Proto's own library (pycapnp) and openpilot's schemas.

    python write_logs.py FOLDER_WITH_LOG_CAPNP

A car begins to the north and turns left on a circle of 60 m, its speed swinging by 3 m/s in 10.5 s.
`circle--rlog.bz2` holds the messages of today, `before--qlog.bz2` those of 2018.
"""

import bz2
import math
import sys
from pathlib import Path
from typing import Any

import capnp  # type: ignore[import-not-found]

RADIUS_M, START_NS = 60.0, 10**12
HERE = Path(__file__).parent


def event(log: Any, stamp_ns: int) -> Any:
    """Return a message with nothing but its time."""
    made = log.Event.new_message()
    made.logMonoTime = stamp_ns
    return made


def circle(log: Any) -> tuple[list[Any], list[Any]]:
    """Return the messages of today and those of 2018."""
    today: list[Any] = []
    before: list[Any] = []
    for tick in range(400):
        time_s = 0.05 * tick
        stamp_ns = START_NS + round(time_s * 1e9)
        speed = 8.0 + 3.0 * math.sin(0.6 * time_s)
        yaw = (8.0 * time_s + 5.0 * (1.0 - math.cos(0.6 * time_s))) / RADIUS_M
        north, west = RADIUS_M * math.sin(yaw), RADIUS_M * (1.0 - math.cos(yaw))
        lat, lon = 52.5 + north / 111_277.0, 13.4 - west / 67_979.0
        # The sensors' x is up, y left and z backwards.
        force = (9.8, speed**2 / RADIUS_M, -1.8 * math.cos(0.6 * time_s))
        made = event(log, stamp_ns)
        car = made.init("carState")
        car.vEgo, car.steeringAngleDeg, car.gearShifter = speed, 30.0, "drive"
        car.leftBlinker = tick > 200
        today.append(made)
        if tick % 2 == 0:
            made = event(log, stamp_ns + 1000)
            fix = made.init("gpsLocationExternal")
            fix.latitude, fix.longitude, fix.altitude, fix.speed = lat, lon, 80.0, speed
            fix.bearingDeg, fix.horizontalAccuracy = -math.degrees(yaw) % 360.0, 1.5
            fix.hasFix = tick > 4
            today.append(made)
            made = event(log, stamp_ns + 1500)
            other = made.init("gpsLocation")
            other.latitude, other.longitude, other.flags = 1.0, 1.0, 1
            today.append(made)
        made = event(log, stamp_ns + 2000)
        made.init("accelerometer").init("acceleration").v = force
        today.append(made)
        made = event(log, stamp_ns + 3000)
        made.init("gyroscope").init("gyroUncalibrated").v = (speed / RADIUS_M, 0.0, 0.0)
        today.append(made)
        made = event(log, stamp_ns + 2000)
        sensors = made.init("sensorEventsDEPRECATED", 2)
        sensors[0].init("acceleration").v = force
        sensors[1].init("gyroUncalibrated").v = (speed / RADIUS_M, 0.0, 0.0)
        before.append(made)
        made = event(log, stamp_ns + 2500)
        fix = made.init("gpsLocation")
        fix.latitude, fix.longitude, fix.speed, fix.flags = lat, lon, speed, 1
        before.append(made)
    return today, before


if __name__ == "__main__":
    capnp.remove_import_hook()
    schemas = sys.argv[1]
    today, before = circle(capnp.load(f"{schemas}/log.capnp", imports=[schemas]))
    for name, messages in (("circle--rlog.bz2", today), ("before--qlog.bz2", before)):
        data = b"".join(message.to_bytes() for message in messages)
        (HERE / name).write_bytes(bz2.compress(data))
