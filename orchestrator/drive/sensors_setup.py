"""What the process of virtual sensors is started with, where a drive has any."""

from __future__ import annotations

from typing import Any

from foretwin.contracts.setup import SensorSetup, SensorsSetup
from foretwin.orchestrator.drive.watcher_setups import WATCHERS
from foretwin.orchestrator.plan import DrivePlan
from foretwin.orchestrator.sensor_config import SensorConfig
from foretwin.sim_worker.sensors.sensor_file import sensor_of, sensor_text

SENSORS, MODULE = "sensors", "sim_worker.sensors.process"
TOLD_WORLDS = (*WATCHERS, SENSORS)
"""Who has missed which World counts, where it was started again."""


def read_sensor(config: SensorConfig) -> SensorSetup:
    """Return a sensor whose file was read and checked; raises UserError or MissingFileError."""
    text, name = sensor_text(config.file)
    sensor_of(text, name)
    return SensorSetup(text=text, name=name, sees=config.sees)


def made(plan: DrivePlan, base: dict[str, Any]) -> SensorsSetup:
    """Return how the process is set; `base` is what all processes are told."""
    return SensorsSetup(
        **base, worlds_dir=str(plan.worlds_dir), sensors=plan.sensors, seed=plan.config.seed
    )


def runs(plan: DrivePlan) -> bool:
    """Whether a drive has it."""
    return bool(plan.sensors)
