"""What the process of virtual sensors is started with, where a drive has any."""

from __future__ import annotations

from typing import Any

from foretwin.contracts.errors import UserError
from foretwin.contracts.point_cloud import Mount
from foretwin.contracts.setup import SensorSetup, SensorsSetup
from foretwin.orchestrator.drive.watcher_setups import WATCHERS
from foretwin.orchestrator.plan import DrivePlan
from foretwin.orchestrator.sensor_config import SensorConfig
from foretwin.sim_worker.sensors.offscreen import check_drawing
from foretwin.sim_worker.sensors.sensor_file import sensor_of, sensor_text
from foretwin.telemetry.ros2.mapping import MappingError, MappingFile
from foretwin.telemetry.ros2.rows import Source

SENSORS, MODULE = "sensors", "sim_worker.sensors.process"
_KIND_OF_SOURCE: dict[Source, str] = {"point_cloud": "lidar", "radar_list": "radar"}
TOLD_WORLDS = (*WATCHERS, SENSORS)
"""Who has missed which World counts, where it was started again."""


def read_sensor(config: SensorConfig) -> SensorSetup:
    """Return a sensor whose file was read and checked; raises UserError or MissingFileError.

    A camera is refused where nothing can be drawn.
    """
    text, name = sensor_text(config.file)
    kind = sensor_of(text, name).kind_name
    if config.sees == "real" and kind != "lidar":
        raise UserError(f'{name}: sees = "real": of kind lidar, and this is of kind {kind}')
    if kind == "camera":
        check_drawing()
    return SensorSetup(text=text, name=name, sees=config.sees)


def mounts(sensors: tuple[SensorSetup, ...]) -> tuple[tuple[str, Mount], ...]:
    """Return where sensors sit, by their names."""
    files = (sensor_of(one.text, one.name) for one in sensors)
    return tuple((file.name, file.mount) for file in files)


def check_measured(sensors: tuple[SensorSetup, ...], ros2: MappingFile | None) -> None:
    """Raise MappingError where a mapping passes what no sensor of the drive measures, or two do."""
    if ros2 is None:
        return
    files = [(sensor_of(one.text, one.name), one.sees) for one in sensors]
    mapping = ros2.mapping
    wanted = [
        (row.topic, row.sensor, _KIND_OF_SOURCE[row.source], "")
        for row in mapping.outwards
        if row.sensor
    ]
    wanted += [(row.topic, row.sensor, "lidar", "real") for row in mapping.inwards if row.sensor]
    for topic, sensor, kind, how in wanted:
        told = [(file.name, sees) for file, sees in files if file.kind_name == kind]
        found = [name for name, sees in told if name == sensor and how in ("", sees)]
        if len(found) != 1:
            that = "of that name" + (how and f' with sees = "{how}"')
            known = ", ".join(sorted({name for name, _ in told})) or "none"
            raise MappingError(
                f"{ros2.name}: topic {topic}: sensor {sensor!r}: {len(found)} [[sensors]] {that} "
                f"that are a {kind}, one is needed; names are {known}"
            )


def made(plan: DrivePlan, base: dict[str, Any]) -> SensorsSetup:
    """Return how the process is set; `base` is what all processes are told."""
    return SensorsSetup(
        **base,
        worlds_dir=str(plan.worlds_dir),
        turns_dir=str(plan.processes_dir),
        sensors=plan.sensors,
        seed=plan.config.seed,
    )


def runs(plan: DrivePlan) -> bool:
    """Whether a drive has it."""
    return bool(plan.sensors)
