"""A car that reverses: its heading looks the other way than its course; speeds may be unsigned."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from foretwin.contracts.arrays import Array
from foretwin.telemetry.logs.declare import propose
from tests.telemetry.logs.declare.test_position_units import written

METRE_DEG = 1.0 / 111_195.0


def there_and_back() -> dict[str, Array]:
    """A minute and a half forwards, a stop, 20 s backwards, and on again."""
    time_s = np.arange(0.0, 180.0, 0.1)
    speed = 7.0 + 3.0 * np.sin(time_s / 5.0)
    speed = np.where((time_s > 90.0) & (time_s < 95.0), 0.0, speed)
    speed = np.where((time_s >= 95.0) & (time_s < 115.0), -4.0 - np.sin(time_s), speed)
    yaw = np.cumsum(speed * 0.02 * np.sin(time_s / 8.0)) * 0.1
    x, y = (np.cumsum(speed * side(yaw)) * 0.1 for side in (np.cos, np.sin))
    return {
        "t": time_s,
        "lat": 48.1 + y * METRE_DEG,
        "lon": 11.6 + x * METRE_DEG / np.cos(np.radians(48.1)),
        "v": 3.6 * speed,
        "heading": np.degrees(np.mod(0.5 * np.pi - yaw, 2.0 * np.pi)),
    }


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_signed_speed_is_a_speed_and_the_heading_that_of_the_car(
    tmp_path: Path, sign: float
) -> None:
    columns = there_and_back()
    columns["v"] = sign * columns["v"]
    found = propose(written(tmp_path, columns))
    assert found.declaration is not None
    assert found.declaration.speed is not None
    assert found.declaration.speed.forward is not None
    assert found.declaration.speed.forward.unit == "km/h"
    assert found.declaration.speed.forward.negate == (sign < 0.0)
    assert found.declaration.heading is not None
    assert (found.declaration.heading.zero, found.declaration.heading.offset_deg) == ("north", 0.0)
    assert not any("backwards" in line for line in found.unknown)


def test_a_speed_that_is_never_negative_is_told_where_the_car_reverses(tmp_path: Path) -> None:
    columns = there_and_back()
    columns["v"] = np.abs(columns["v"])
    found = propose(written(tmp_path, columns))
    assert found.declaration is not None
    assert found.declaration.speed is not None
    said = next(line for line in found.unknown if line.startswith("v: never negative"))
    seconds = int(said.partition("backwards for ")[2].partition(" s")[0])
    assert 14 <= seconds <= 21


def test_a_car_that_never_reverses_is_not_said_to(tmp_path: Path) -> None:
    columns = {name: values[:900] for name, values in there_and_back().items()}
    found = propose(written(tmp_path, columns))
    assert not any("negative" in line for line in found.unknown)


def test_a_heading_against_the_compass_is_told_as_a_track_that_may_be_mirrored(
    tmp_path: Path,
) -> None:
    columns = there_and_back()
    assert not any("to the west" in line for line in propose(written(tmp_path, columns)).unknown)
    columns["lon"] = -columns["lon"]
    found = propose(written(tmp_path, columns))
    assert found.declaration is not None
    assert found.declaration.heading is not None
    assert any("if lon grew to the west" in line for line in found.unknown)
