"""Sensors of a car that drives: a cloud each time a turn is over, of what was there as it began."""

from __future__ import annotations

from typing import Any

import msgspec
import numpy as np
import pytest

from foretwin.contracts.drive import RoadUsers
from foretwin.contracts.point_cloud import PointCloud
from foretwin.contracts.radar_list import RadarList
from foretwin.contracts.too_old import USERS_FOR_NS
from foretwin.sim_worker.sensors.virtual_sensors import VirtualSensors
from tests.sim_worker.places import box, crossroads, state_at
from tests.sim_worker.sensors.test_lidar import exact
from tests.sim_worker.sensors.test_radar import exact as radar
from tests.sim_worker.sensors.test_ray_world import user

MS = 1_000_000
TOWN = crossroads(buildings=(box(20.0, 0.0, 2.0, 30.0),))


def driven(
    sensors: VirtualSensors, until_ms: int, *, from_ms: int = 0, every_ms: int = 20
) -> list[Any]:
    """Stand at the origin, a state each 20 ms."""
    stamps = range(from_ms, until_ms + 1, every_ms)
    clouds = []
    for stamp in stamps:
        sensors.take_state(state_at(0.0, 0.0, speed=0.0, stamp_ns=stamp * MS))
        clouds += sensors.measured()
    return clouds


def users(stamp_ms: int, *names: str, x: float = 10.0, speed_mps: float = 0.0) -> RoadUsers:
    there = (user(x, 0.0, 0.0, user_id=name, speed_mps=speed_mps) for name in names)
    return RoadUsers(stamp_ns=stamp_ms * MS, users=tuple(there))


def ahead_m(cloud: PointCloud) -> float:
    """How far away is what the level ring sees straight ahead."""
    points = cloud.points[cloud.points[:, 4] == 2]
    return float(points[np.argmin(np.abs(np.arctan2(points[:, 1], points[:, 0]))), 0])


def test_a_turn_is_told_when_it_is_over_with_the_stamp_of_its_beginning() -> None:
    sensors = VirtualSensors([(exact(), "world")])
    sensors.use_world(TOWN)
    clouds = driven(sensors, 300)

    assert [cloud.stamp_ns // MS for cloud in clouds] == [0, 100, 200]
    assert {cloud.sensor for cloud in clouds} == {"exact"}
    assert ahead_m(clouds[0]) == pytest.approx(18.0, abs=1e-3)


def test_road_users_are_there_for_as_long_as_somebody_says_so() -> None:
    sensors = VirtualSensors([(exact(), "world")])
    sensors.use_world(TOWN)
    sensors.take_users(users(0, "van"))
    until_ms = USERS_FOR_NS // MS
    clouds = driven(sensors, until_ms + 300)
    seen = [ahead_m(cloud) < 10.0 for cloud in clouds]

    assert seen == [cloud.stamp_ns <= USERS_FOR_NS for cloud in clouds]
    assert True in seen
    assert False in seen


def test_the_last_word_on_a_road_user_counts_and_is_led_on() -> None:
    sensors = VirtualSensors([(exact(), "users")])
    sensors.take_users(users(0, "van", x=30.0))
    sensors.take_users(users(60, "van", x=12.0, speed_mps=10.0))
    sensors.take_users(users(30, "van", x=25.0))
    clouds = driven(sensors, 200)

    # The rear of a van of 6 m whose middle is at 12 m at 60 ms; ahead is seen 50 ms into a turn.
    wanted = [12.0 - 3.0 + 10.0 * (begun_s + 0.05 - 0.06) for begun_s in (0.0, 0.1)]
    assert [ahead_m(cloud) for cloud in clouds] == pytest.approx(wanted, abs=0.02)


def test_a_sensor_of_road_users_alone_sees_no_world_and_needs_none() -> None:
    sensors = VirtualSensors([(exact(), "users"), (exact(), "world")])
    sensors.take_users(users(0, "van"))
    without = driven(sensors, 100)
    sensors.use_world(TOWN)
    sensors.take_users(users(100, "van"))
    alone, whole = driven(sensors, 200, from_ms=120)

    assert len(without) == 1
    assert ahead_m(without[0]) == ahead_m(alone) == pytest.approx(7.0, abs=1e-3)
    assert len(whole.points) > 2 * len(alone.points)


def test_who_missed_states_or_whose_clock_was_set_begins_anew() -> None:
    sensors = VirtualSensors([(exact(), "world")])
    sensors.use_world(TOWN)
    assert len(driven(sensors, 200)) == 2
    assert driven(sensors, 5000, from_ms=5000) == []
    assert [cloud.stamp_ns // MS for cloud in driven(sensors, 5100, from_ms=5020)] == [5000]
    assert driven(sensors, 80) == []


def test_without_a_heading_nothing_is_measured() -> None:
    sensors = VirtualSensors([(exact(), "world")])
    sensors.use_world(TOWN)
    blind = [state_at(0.0, 0.0, stamp_ns=k * 50 * MS) for k in range(4)]
    for one in blind:
        sensors.take_state(msgspec.structs.replace(one, yaw_valid=False))
        assert sensors.measured() == []


def test_the_same_drive_and_seed_give_the_same_noise() -> None:
    def clouds(seed: int) -> list[Any]:
        sensors = VirtualSensors([(exact(range_std_m=0.05), "world")], seed=seed)
        sensors.use_world(TOWN)
        return driven(sensors, 200)

    first, again, other = clouds(1), clouds(1), clouds(2)
    assert all(np.array_equal(a.points, b.points) for a, b in zip(first, again, strict=True))
    assert not np.array_equal(first[0].points[:, :3], other[0].points[:, :3])
    assert not np.array_equal(first[0].points[:, :3], first[1].points[:, :3])


def test_turns_begin_at_whole_periods_however_the_states_come() -> None:
    """States of 33 Hz, none at a turn's beginning: the car drives on from where it was."""
    sensors = VirtualSensors([(exact(), "world")])
    sensors.use_world(TOWN)
    clouds = []
    for k in range(32):
        stamp_ns = k * 30 * MS + 7 * MS
        sensors.take_state(state_at(10.0 * stamp_ns * 1e-9, 0.0, speed=10.0, stamp_ns=stamp_ns))
        clouds += sensors.measured()

    assert [cloud.stamp_ns // MS for cloud in clouds] == list(range(0, 900, 100))
    # Ahead is seen half a turn after it began.
    wanted = [18.0 - 10.0 * (0.1 * k + 0.05) for k in range(9)]
    assert [ahead_m(cloud) for cloud in clouds] == pytest.approx(wanted, abs=0.02)
    assert not sensors.passed_over.total()


def test_who_is_asked_late_measures_the_newest_turn_and_counts_the_others() -> None:
    sensors = VirtualSensors([(exact(), "users"), (exact(), "world")])
    sensors.use_world(TOWN)
    for stamp_ms in range(0, 400, 20):
        sensors.take_state(state_at(0.0, 0.0, speed=0.0, stamp_ns=stamp_ms * MS))

    assert [cloud.stamp_ns // MS for cloud in sensors.measured()] == [200, 200]
    assert sensors.passed_over == {"exact": 4}
    assert sensors.measured() == []
    # States that are missing: of two turns it is not known how they began.
    sensors.take_state(state_at(0.0, 0.0, speed=0.0, stamp_ns=620 * MS))
    assert [cloud.stamp_ns // MS for cloud in sensors.measured()] == [300, 300]
    assert sensors.passed_over == {"exact": 8}


def test_road_users_are_put_into_the_clouds_of_the_cars_own_sensor() -> None:
    sensors = VirtualSensors([(exact(), "real")])
    sensors.take_users(users(0, "van"))
    assert driven(sensors, 300) == [], "it has no turns of its own"
    wall = np.array([[18.0, 0.0, 1.5, 1.0, 2.0, 0.05]], np.float32)
    for stamp_ms, sensor in ((150, "exact"), (100, "exact"), (100, "other")):
        sensors.take_real(PointCloud(stamp_ns=stamp_ms * MS, points=wall, sensor=sensor))
    (merged,) = sensors.measured()

    assert (merged.stamp_ns, merged.sensor) == (100 * MS, "exact")
    assert len(merged.points) > 40
    assert ahead_m(merged) == pytest.approx(7.0, abs=1e-3)
    assert sensors.passed_over == {"exact": 1}
    late = PointCloud(stamp_ns=2000 * MS, points=wall, sensor="exact")
    sensors.take_real(late)
    assert sensors.measured() == [late], "as it came where it is not known where the car was"


def test_a_radar_tells_a_list_when_its_turn_is_over() -> None:
    """A van of 6 m whose middle is at 60 m and comes at 10 m/s; the list is of the beginning."""
    sensors = VirtualSensors([(radar(), "world"), (radar(rate_hz=10.0), "users")])
    sensors.use_world(TOWN)
    sensors.take_users(users(0, "hidden", x=60.0, speed_mps=-10.0))
    lists = driven(sensors, 100)

    assert [(one.stamp_ns // MS, one.sensor) for one in lists] == [
        (0, "exact"), (50, "exact"), (0, "exact")
    ]  # fmt: skip
    assert [len(one.returns) for one in lists if isinstance(one, RadarList)] == [0, 0, 1]
    assert isinstance(lists[2], RadarList)
    assert lists[2].returns[0, [0, 3]] == pytest.approx([57.0, -10.0])
    assert lists[2].mount == radar().mount


def test_a_delay_is_waited_for_and_moves_no_stamp() -> None:
    late = VirtualSensors([(msgspec.structs.replace(radar(), delay_s=0.13), "users")])
    heard = []
    for stamp_ms in range(0, 401, 10):
        late.take_state(state_at(0.0, 0.0, speed=0.0, stamp_ns=stamp_ms * MS))
        heard += [(stamp_ms, one.stamp_ns // MS) for one in late.measured()]

    assert heard == [(begun + 50 + 130, begun) for begun in range(0, 201, 50)]
    assert not late.passed_over.total()


def test_a_sensors_own_seed_makes_other_noise() -> None:
    def first(seed: int) -> bytes:
        own = msgspec.structs.replace(radar(range_std_m=1.0), seed=seed)
        sensors = VirtualSensors([(own, "users")])
        sensors.take_users(users(0, "van"))
        (one,) = driven(sensors, 60)
        assert isinstance(one, RadarList)
        return one.returns.tobytes()

    assert first(3) == first(3) != first(4)


def told_under_load(takes_ms: dict[str, int]) -> VirtualSensors:
    """Drive for 10 s, in which each turn takes as long as is said to be measured."""
    kinds = (("slow", radar(rate_hz=10.0)), ("quick", radar(rate_hz=20.0)))
    files = [(msgspec.structs.replace(one, name=name), "users") for name, one in kinds]
    sensors = VirtualSensors(files)  # type: ignore[arg-type]
    free_ms = 0
    for stamp_ms in range(0, 10_001, 10):
        sensors.take_state(state_at(0.0, 0.0, speed=0.0, stamp_ns=stamp_ms * MS))
        if stamp_ms >= free_ms and (one := sensors.next_measured()) is not None:
            free_ms = stamp_ms + takes_ms[one.sensor]
    return sensors


def test_where_there_is_no_time_for_all_each_tells_the_same_share() -> None:
    sensors = told_under_load({"slow": 100, "quick": 50})
    shares = [sensors.told[name] / turns for name, turns in (("slow", 100), ("quick", 200))]
    assert shares == pytest.approx([0.5, 0.5], abs=0.05)
    for name, turns in (("slow", 100), ("quick", 200)):
        assert sensors.told[name] + sensors.passed_over[name] == pytest.approx(turns, abs=2)
    assert not told_under_load({"slow": 20, "quick": 20}).passed_over.total()


def test_turns_are_counted_whose_states_could_not_be_taken() -> None:
    sensors = VirtualSensors([(exact(), "users")])
    driven(sensors, 200)
    late = state_at(0.0, 0.0, speed=0.0, stamp_ns=1020 * MS)
    sensors.take_state(late, behind=True)
    assert [one.stamp_ns // MS for one in sensors.measured()] == [200]
    assert sensors.passed_over == {"exact": 7}
