"""Settings of vehicles beside the car that cannot be used: told in one line, before anything."""

from __future__ import annotations

from pathlib import Path

import pytest

from foretwin.contracts.errors import UserError
from foretwin.orchestrator.config import ConfigError, DriveConfig, OtherVehicleConfig
from foretwin.orchestrator.config_file import load_config
from foretwin.orchestrator.drive.plan import read_inputs


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ('[[vehicles]]\nid = "v"', "vehicles, v: needs exactly one of log = FILE, live = true"),
        ('[[vehicles]]\nid = "v"\nlive = true\nseen_as = "3"', "vehicles, v: needs exactly one"),
        ('[[vehicles]]\nid = "v"\nlive = true\nanchor = "l"', "anchor = FILE needs log or ros2"),
        ('[[vehicles]]\nid = "v"\nlog = "x"\nros2 = "y"', "ros2 = MAPPING needs live = true"),
        ('[[vehicles]]\nid = "v"\nlive = true\nrole = "all"', "role all is the car's alone"),
        ('[[vehicles]]\nid = "a b"\nlive = true', "must be one word"),
        ('[[vehicles]]\nid = "ego"\nlive = true', "ids ego, ego must differ"),
        ('speed = "max"\n[[vehicles]]\nid = "v"\nlive = true', "knows no --speed but 1"),
        (
            '[[vehicles]]\nid = "v"\nrole = "wheel"',
            "vehicles[0].role 'wheel': one of all, ghost, shadow, twin",
        ),
        ("[follow]\njerk_mps3 = -1.0", "follow: jerk_mps3 -1.0: above 0"),
        ("[follow]\njerk_mps3 = 100.0", "follow: jerk_mps3 100.0: at most 60 times"),
        ('correction = "hard"', "correction 'hard': one of follow, free"),
    ],
)
def test_settings_that_cannot_be_used_are_told_in_one_line(
    tmp_path: Path, text: str, told: str
) -> None:
    file = tmp_path / "drive.toml"
    file.write_text(text + "\n")
    with pytest.raises(ConfigError) as refused:
        load_config(file, {})
    assert told in str(refused.value)
    assert "\n" not in str(refused.value)


def test_a_log_beside_that_is_not_there_is_told_before_anything_begins(tmp_path: Path) -> None:
    config = DriveConfig(
        vehicles=(OtherVehicleConfig(id="van", log=str(tmp_path / "no.mcap")),), out=str(tmp_path)
    )
    with pytest.raises(FileNotFoundError, match=r"no\.mcap of van: no such file or folder"):
        read_inputs(config.validate())


@pytest.mark.parametrize(
    ("text", "told"),
    [(None, "no such file"), ('dialect = "ros2dds"\n', r"no \[\[in\]\]: nothing of van would be")],
)
def test_a_mapping_of_a_vehicle_beside_that_is_of_no_use_is_told_before_anything_begins(
    tmp_path: Path, text: str | None, told: str
) -> None:
    file = tmp_path / "van.toml"
    if text is not None:
        file.write_text(text)
    config = DriveConfig(
        vehicles=(OtherVehicleConfig(id="van", live=True, ros2=str(file)),), out=str(tmp_path)
    )
    with pytest.raises((FileNotFoundError, UserError), match=told):
        read_inputs(config.validate())
