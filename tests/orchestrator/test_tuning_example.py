"""The files that docs/tuning-guide.md begins with."""

from __future__ import annotations

from pathlib import Path

import pytest

from foretwin.contracts.errors import UserError
from foretwin.orchestrator.config import DriveConfig
from foretwin.orchestrator.config_file import load_config
from foretwin.orchestrator.drive.plan import read_inputs
from foretwin.sim_worker.vehicle.parameters import load_vehicle
from foretwin.telemetry.standin.parameters import read_parameters

TUNING = Path(__file__).parents[2] / "examples" / "tuning"


def test_the_guide_s_car_is_another_one_than_the_twin_believes() -> None:
    config = load_config(TUNING / "first_drive.toml", {})
    assert config.lock_step
    assert config.standin_parameters is not None
    assert TUNING.parents[1] / config.standin_parameters == TUNING / "other_car.toml"
    car, believed = read_parameters(TUNING / "other_car.toml").car, load_vehicle()
    assert car.steering_ratio != believed.steering_ratio.value
    assert car.brake_gain != believed.brake_gain.value


@pytest.mark.parametrize("text", ["[car]\nwheels = 4\n", "not TOML"])
def test_a_wrong_file_of_the_stand_in_is_told_before_the_drive(tmp_path: Path, text: str) -> None:
    file = tmp_path / "car.toml"
    file.write_text(text)
    with pytest.raises(UserError, match=r"car\.toml"):
        read_inputs(DriveConfig(standin_parameters=str(file), view="none").validate())
    file.unlink()
    with pytest.raises(FileNotFoundError):
        read_inputs(DriveConfig(standin_parameters=str(file), view="none").validate())
