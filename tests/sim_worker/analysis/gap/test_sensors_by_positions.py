"""Which sensors the positions of a whole drive accuse, and which positions may."""

from __future__ import annotations

import numpy as np
import pytest
from msgspec.structs import replace

from foretwin.contracts.drive import GnssFix
from foretwin.contracts.frames import GeoPoint
from foretwin.sim_worker.analysis.gap.sensors_by_positions import accused_sensors, are_precise
from tests.sim_worker.standin_drives import city_minute


def fixes(*, period_s: float, std_m: float | None) -> list[GnssFix]:
    place = GeoPoint(48.0, 11.0)
    stamps = (round(count * period_s * 1e9) for count in range(10))
    return [GnssFix(stamp_ns=stamp, position=place, std_m=std_m) for stamp in stamps]


@pytest.mark.parametrize(
    ("period_s", "std_m", "precise"),
    [(0.1, 0.02, True), (1.0, 0.02, False), (0.1, 3.0, False), (0.1, None, False)],
)
def test_positions_are_precise_that_are_dense_and_good(
    period_s: float, std_m: float | None, precise: bool
) -> None:
    assert are_precise(fixes(period_s=period_s, std_m=std_m)) is precise


@pytest.mark.parametrize(("off_m", "precise"), [(0.05, True), (0.5, False)])
def test_positions_that_lie_beside_one_another_are_not(off_m: float, precise: bool) -> None:
    """Of a car at 10 m/s in a bend, whatever they say that they are good to."""
    drawn = np.random.default_rng(1)
    told = []
    for count, fix in enumerate(fixes(period_s=0.1, std_m=0.02) * 4):
        x, y = count + drawn.normal(0.0, off_m), 0.005 * count**2 + drawn.normal(0.0, off_m)
        place = GeoPoint(48.0 + x / 111_200.0, 11.0 + y / 74_400.0)
        told.append(replace(fix, stamp_ns=100_000_000 * count, position=place))
    assert are_precise(told) is precise


def test_four_positions_are_the_fewest_that_accuse() -> None:
    few = fixes(period_s=0.1, std_m=0.02)
    assert not are_precise(few[:3])
    assert are_precise(few[:4])


@pytest.mark.parametrize(
    ("speed_gain", "gyro_gain", "told"),
    [
        (1.0, 1.0, {}),
        (3.6, 1.0, {"speed_sensor": "sent in kilometres per hour?"}),
        (1.0, -1.0, {"gyro_sensor": "its sign is wrong?"}),
        (0.447, 0.5, {"speed_sensor": "taken for miles per hour?", "gyro_sensor": "0.50 of"}),
    ],
)
def test_a_whole_drive_accuses_what_its_positions_contradict(
    speed_gain: float, gyro_gain: float, told: dict[str, str]
) -> None:
    record = city_minute()
    faulty = record._replace(
        speed_mps=speed_gain * record.speed_mps, yaw_rate_radps=gyro_gain * record.yaw_rate_radps
    )
    found = {one.cause: one.text for one in accused_sensors(faulty)}
    assert found.keys() == told.keys()
    for cause, words in told.items():
        assert words in found[cause]
