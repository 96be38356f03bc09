"""The mapping of a drive's ROS 2 topics, checked against the drive's own configuration."""

from __future__ import annotations

from pathlib import Path

from foretwin.orchestrator.config import DriveConfig, OtherVehicleConfig
from foretwin.telemetry.ros2.mapping import MappingError, MappingFile, read_mapping
from foretwin.telemetry.ros_messages.parts import LANELET_ROUTE


def read_ros2(config: DriveConfig) -> MappingFile | None:
    """Return the mapping of a drive, None where it speaks no ROS 2.

    Raises MappingError or FileNotFoundError, one line.
    """
    if config.ros2 is None:
        return None
    read = read_mapping(Path(config.ros2))
    if config.route == "live":
        if not any(row.type == LANELET_ROUTE for row in read.mapping.inwards):
            raise MappingError(f"{read.name}: --route live needs an [[in]] of type {LANELET_ROUTE}")
        if read.mapping.map_place is None:
            raise MappingError(f"{read.name}: --route live needs [map] lat_deg, lon_deg")
    beside = {one.id: one for one in config.vehicles}
    for name in read.mapping.mirrored.vehicles:
        where = f"{read.name}: [mirrored] vehicles {name!r}"
        if name not in beside:
            known = ", ".join(sorted(beside)) or "none"
            raise MappingError(f"{where}: not in the drive's [[vehicles]], which are {known}")
        if beside[name].seen_as is not None:
            raise MappingError(f"{where}: the car detects it itself; nothing of that comes back")
    return _reachable(read, config)


def read_ros2_beside(config: OtherVehicleConfig, drive: DriveConfig) -> MappingFile | None:
    """Return the mapping of a vehicle beside the car, None where it speaks no ROS 2.

    Raises MappingError or FileNotFoundError, one line.
    """
    if config.ros2 is None:
        return None
    read = read_mapping(Path(config.ros2))
    if not read.mapping.inwards:
        raise MappingError(f"{read.name}: no [[in]]: nothing of {config.id} would be heard")
    return _reachable(read, drive)


def _reachable(read: MappingFile, config: DriveConfig) -> MappingFile:
    """Return a mapping whose topics can come; raises MappingError where nobody could send any."""
    if read.mapping.endpoint is None and not config.insecure:
        raise MappingError(
            f"{read.name}: endpoint must be named, that of the car's router or bridge: the run's "
            "own bus speaks ROS with --endpoint tcp/HOST:PORT --insecure alone"
        )
    return read
