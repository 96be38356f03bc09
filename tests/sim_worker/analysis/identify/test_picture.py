"""Pictures of an identification: one plot for each estimate with a value, none without any."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from foretwin.contracts.tuning import Identification, ParameterEstimate
from foretwin.sim_worker.analysis.identify.picture import draw_estimates, draw_steering
from foretwin.sim_worker.vehicle.parameters import load_vehicle
from tests.sim_worker.standin_drives import city_minute, straight_minute

PNG = b"\x89PNG\r\n"


def told(*values: float | None) -> Identification:
    estimates = tuple(
        ParameterEstimate(
            name=f"p{k}",
            value=value,
            low=None if value is None else value - 0.1,
            high=None if value is None else value + 0.1,
            prior=1.0,
        )
        for k, value in enumerate(values)
    )
    return Identification(vehicle_id="car", from_stamp_ns=0, stamp_ns=1, estimates=estimates)


def test_estimates_with_a_value_are_drawn_and_nothing_is_written_without_one(
    tmp_path: Path,
) -> None:
    draw_estimates(told(None, None), tmp_path / "none.png")
    draw_estimates(told(1.0, None), tmp_path / "one.png")
    draw_estimates(told(*(1.0 + k for k in range(5))), tmp_path / "five.png")

    assert not (tmp_path / "none.png").exists()
    one, five = (tmp_path / f"{name}.png" for name in ("one", "five"))
    assert one.read_bytes().startswith(PNG)
    assert five.stat().st_size > 2 * one.stat().st_size


def test_the_steering_is_drawn_where_the_record_tells_of_it(tmp_path: Path) -> None:
    draw_steering(city_minute(), load_vehicle(), tmp_path / "steering.png")

    assert (tmp_path / "steering.png").read_bytes().startswith(PNG)
    record = straight_minute()
    blind = record._replace(wheel_rad=np.full(len(record.stamp_ns), np.nan))
    with pytest.raises(ValueError, match="steering-wheel angle"):
        draw_steering(blind, load_vehicle(), tmp_path / "none.png")
