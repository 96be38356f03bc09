"""The configuration of a drive from its TOML file, with the flags that were given over it."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from foretwin.contracts.toml_file import TomlFile, load_toml
from foretwin.orchestrator.config import ConfigError, DriveConfig
from foretwin.orchestrator.settings import setting_of, settings_of_flags


def load_config(path: Path | None, overrides: dict[str, Any]) -> DriveConfig:
    """Read the TOML file, lay the flags that were given over it, and check the whole.

    `speed` may be a number or `max` in both. Raises FileNotFoundError or ConfigError, one line.
    """
    file = None if path is None else _read_settings(path)
    written = {} if file is None else file.values
    flags = {name: value for name, value in overrides.items() if value is not None}
    if "speed" in flags:
        flags["speed"] = parse_speed(flags["speed"])
    for table, key in (("virtual_traffic", "source"), ("siblings", "engine")):
        if table in flags:
            flags[table] = {**written.get(table, {}), key: flags[table]}
    config = settings_of_flags(written | flags, DriveConfig, error=ConfigError)
    try:
        return config.validate()
    except ConfigError as wrong:
        fault = setting_of(str(wrong))
        if file is None or fault is None or fault.name in flags or fault.name not in written:
            raise
        raise file.wrong(f"{fault.name}{fault.rest}") from wrong


def _read_settings(path: Path) -> TomlFile:
    file = load_toml(path, "configuration", error=ConfigError)
    if "towards_vehicle" in file.values:
        # Else one file could hold both switches.
        raise file.wrong("towards_vehicle: on the command line alone")
    if "speed" in file.values:
        try:
            file.values["speed"] = parse_speed(file.values["speed"])
        except ConfigError as wrong:
            raise file.wrong(str(wrong).removeprefix("--")) from None
    file.convert(DriveConfig)
    return file


def parse_speed(value: object) -> float | None:
    """Return the replay speed, None for `max`; raises ConfigError."""
    if value == "max":
        return None
    try:
        return float(str(value))
    except ValueError:
        raise ConfigError(f"--speed {value}: a number above 0, or max") from None
