"""What only some formats let one choose."""

from __future__ import annotations

from typing import Literal, get_args

OpenDriveVersion = Literal["1.8", "1.4"]
OPENDRIVE_VERSIONS: tuple[OpenDriveVersion, ...] = get_args(OpenDriveVersion)
Lanelet2Dialect = Literal["lanelet2", "autoware"]
LANELET2_DIALECTS: tuple[Lanelet2Dialect, ...] = get_args(Lanelet2Dialect)
Simulator = Literal["classic", "gazebo"]
SIMULATORS: tuple[Simulator, ...] = get_args(Simulator)
VehicleKind = Literal["twin", "shadow", "ghost"]
VEHICLE_KINDS: tuple[VehicleKind, ...] = get_args(VehicleKind)
