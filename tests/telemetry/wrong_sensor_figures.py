"""What a wrong sensor does to the estimate: `python -m tests.telemetry.wrong_sensor_figures`.

For precise and rough fixes, the largest errors of speed and heading from 30 s on, as the estimator
is and where it believes every sensor. The others (gyro with its
forces, wheels, headings) are right.
"""

from __future__ import annotations

import math
from typing import Any
from unittest import mock

from foretwin.telemetry.estimator.sensor_trust import SensorTrust
from tests.telemetry.position_track import yaw
from tests.telemetry.winding_drive import BRISK, TICK_S, WINDING, Way, driven, truly

PRECISE: dict[str, Any] = {}
ROUGH: dict[str, Any] = {"fix_std_m": 3.0, "fix_every": 50}
WRONG: dict[str, tuple[str, Any]] = {
    "a gyro stuck": ("gyro", lambda _: 0.0),
    "a gyro upside down": ("gyro", lambda rate: -rate),
    "a gyro in degrees": ("gyro", math.degrees),
    "wheels in km/h": ("wheels", lambda speed: 3.6 * speed),
    "wheels in mph": ("wheels", lambda speed: 2.237 * speed),
    "wheels that say nought": ("wheels", lambda _: 0.0),
    "wheels backwards": ("wheels", lambda speed: -speed),
    "headings by a compass": ("heading", lambda yaw: math.pi / 2.0 - yaw),
    "headings to the left": ("heading", lambda yaw: yaw + math.pi / 2.0),
    "headings to the rear": ("heading", lambda yaw: yaw + math.pi),
    "steering to the right": ("steering", lambda angle: -angle),
    "steering of the wheel": ("steering", lambda angle: max(-1.4, min(1.4, 15.0 * angle))),
    "forces stuck": ("forces", lambda _: 0.0),
    "forces in g": ("forces", lambda force: force / 9.8),
    "forces backwards": ("forces", lambda force: -force),
}
CHANNEL = {
    "gyro": "imu",
    "wheels": "speed",
    "heading": "heading",
    "steering": "steering",
    "forces": "forces",
}
"""By sensor, what it is called where it is left out."""


def way_for(sensor: str) -> Way:
    """Return a drive that shows what a sensor is worth: forces are felt where speeds change."""
    return BRISK if sensor == "forces" else WINDING


def errors(states: Any, *, from_s: float, way: Way = WINDING) -> tuple[float, float]:
    """Return the largest errors of speed (m/s) and yaw (rad) from a time on."""
    after = [(way[tick], state) for tick, state in states if tick * TICK_S > from_s]
    assert len(after) * TICK_S > 1.0
    return (
        max(abs(state.speed_mps - speed) for (speed, *_), state in after),
        max(abs(math.remainder(yaw(state) - at, math.tau)) for (_, _, at, *_), state in after),
    )


def main() -> None:
    """Print a row for each wrong sensor, fixes and both estimators."""
    print(f"{'':<26}{'fixes':<10}{'sorted out':<20}believed")
    for wrong, (name, told) in WRONG.items():
        sensors = {"gyro": truly, "wheels": truly, "heading": truly} | {name: told}
        way = way_for(name)
        for title, fixes in (("2 cm 10 Hz", PRECISE), ("3 m 1 Hz", ROUGH)):
            found = [driven(**sensors, **fixes, way=way)[1]]
            with mock.patch.object(SensorTrust, "take_fix"):
                found.append(driven(**sensors, **fixes, way=way)[1])
            both = (errors(states, from_s=30.0, way=way) for states in found)
            row = (f"{off_mps:5.2f} m/s {math.degrees(off_rad):4.0f}°" for off_mps, off_rad in both)
            print(f"{wrong:<26}{title:<10} {'      '.join(row)}", flush=True)


if __name__ == "__main__":
    main()
