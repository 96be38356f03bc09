"""Tables of a fleet: drives weeks apart, a row each second, a new position every few seconds."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from foretwin.telemetry.logs.declare import propose
from foretwin.telemetry.logs.declare.motion import GRID_S, motion_of
from foretwin.telemetry.logs.declare.roles import ROLES, fits_of


def fleet_table(folder: Path, *, every_s: int, seed: int, noise: float = 0.0) -> Path:
    """A quarter of an hour around blocks near Rabat; each position stands for some seconds.

    `noise` is that of the speed, as a share.
    """
    random = np.random.default_rng(seed)
    time_s = np.arange(900)
    speed_mps = np.clip(9 + 6 * np.sin(time_s / 19 + seed) + 3 * np.sin(time_s / 7), 0, None)
    corners = np.cumsum(random.integers(12, 60, 60))
    corners = corners[corners < 900]
    yaw = np.zeros(900)
    yaw[corners] = random.choice([-0.5, 0.5], len(corners)) * np.pi
    yaw = 0.6 + np.cumsum(yaw)
    held = time_s // every_s * every_s
    lat = 34.0 + np.cumsum(speed_mps * np.sin(yaw))[held] / 111_195
    lon = -6.8 + np.cumsum(speed_mps * np.cos(yaw))[held] / 111_195 / np.cos(np.radians(34.0))
    told_kmh = 3.6 * speed_mps * (1 + noise * np.repeat(random.normal(size=45), 20))
    rows = zip(time_s + 1_617_530_423, lat, lon, told_kmh, strict=True)
    path = folder / "fleet.csv"
    path.write_text(
        "time,LAT,LON,Speed\n" + "".join(f"{t},{a:.6f},{b:.6f},{v:.1f}\n" for t, a, b, v in rows)
    )
    return path


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("every_s", [4, 6])
def test_corners_that_are_cut_neither_turn_the_map_round_nor_hide_the_speed(
    tmp_path: Path, every_s: int, seed: int
) -> None:
    proposed = propose(fleet_table(tmp_path, every_s=every_s, seed=seed))
    found = proposed.declaration
    assert found is not None
    assert found.position.latitude is not None
    assert found.position.latitude.column == "LAT"
    assert found.speed is not None
    assert found.speed.forward is not None
    assert (found.speed.forward.column, found.speed.forward.unit) == ("Speed", "km/h")


def test_a_speed_too_rough_to_tell_kmh_from_feet_per_second_is_left_open(tmp_path: Path) -> None:
    proposed = propose(fleet_table(tmp_path, every_s=6, seed=2, noise=0.1))
    assert proposed.declaration is not None
    assert proposed.declaration.speed is None
    said = "\n".join(proposed.unknown)
    assert "Speed: speed.forward in" in said
    assert "km/h" in said
    assert "ft/s" in said


def test_a_speed_known_only_where_the_car_creeps_is_none() -> None:
    time_s = np.arange(0.0, 200.0, 0.5)
    speed_mps = np.where(time_s < 120.0, 1.2 + 1.2 * np.sin(time_s / 9.0), 12.0)
    motion = motion_of(time_s, np.stack([np.cumsum(speed_mps) * 0.5, 0.0 * time_s], axis=1))
    assert motion is not None
    values = np.where(motion.time_s < 110.0, motion.speed_mps, np.nan)
    assert len(values) * GRID_S > 190.0
    assert fits_of(motion, "v", values, ROLES[:1]) == []


def test_weeks_between_two_drives_of_a_table_are_not_gone_through() -> None:
    time_s = np.concatenate([np.arange(0.0, 100.0), 3.0e6 + np.arange(0.0, 200.0)])
    motion = motion_of(time_s, np.stack([10.0 * np.arange(300.0), np.zeros(300)], axis=1))
    assert motion is not None
    assert motion.time_s[0] == 3.0e6
    assert len(motion.time_s) * GRID_S == pytest.approx(199.0)


def test_of_two_cars_in_one_table_it_is_told_that_one_is_left_out(tmp_path: Path) -> None:
    path = fleet_table(tmp_path, every_s=4, seed=0)
    names, *rows = path.read_text().splitlines()
    alone = propose(path).unknown
    path.write_text("\n".join([names, *rows, *rows[200:500], ""]))
    said = "time: 300 of 1200 rows are stamped earlier than rows above them"
    assert not any("stamped earlier" in line for line in alone)
    assert any(line.startswith(said) for line in propose(path).unknown)
