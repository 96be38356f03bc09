"""The stand-in stands before a light that lets nobody pass, and goes on when it does."""

from __future__ import annotations

import math
from typing import Any

import pytest
from msgspec.structs import replace

from foretwin.contracts.frames import geo_pose
from foretwin.contracts.lights import ShownLight, ShownLights, StopPlace
from foretwin.telemetry.standin.lights_ahead import lights_ahead
from foretwin.telemetry.standin.obstacles import FRONT_M
from foretwin.telemetry.standin.parameters import read_parameters
from foretwin.telemetry.standin.source import START_STAMP_NS, StandinSource
from tests.telemetry.lot_car.test_braking import ANCHOR, straight

S = 10**9
PATH = straight(100.0)
LINE_M = 60.0
STANDS_M = LINE_M - FRONT_M - 1.0


def stop(along_m: float = LINE_M, left_m: float = 1.5, yaw_rad: float = 0.0) -> StopPlace:
    """A stop line of the World, where the car on the lot meets it."""
    cos, sin = math.cos(ANCHOR.lot.yaw_rad), math.sin(ANCHOR.lot.yaw_rad)
    x_m, y_m = along_m * cos - left_m * sin, along_m * sin + left_m * cos
    at = geo_pose(ANCHOR.lot.frame, x_m, y_m, ANCHOR.lot.yaw_rad + yaw_rad)
    return StopPlace(**dict(zip(("position", "yaw_rad"), ANCHOR.world_from_lot(*at), strict=True)))


def shown(*, stamp_ns: int = 0, at: StopPlace | None = None, **changed: Any) -> ShownLights:
    light = ShownLight(group_id="a", colour="red", why="set", stops=(at or stop(),))
    return ShownLights(stamp_ns=stamp_ns, world_id="w", lights=(replace(light, **changed),))


def test_a_red_light_is_met_a_metre_before_its_line() -> None:
    (light,) = lights_ahead(PATH, 5.0, shown(), anchor=ANCHOR)
    assert light.s_m == pytest.approx(STANDS_M, abs=0.05)
    assert not light.amber


@pytest.mark.parametrize(
    "changed",
    [
        {"colour": "green"},
        {"colour": "dark"},
        {"why": "plan"},
        {"on_foot": True},
        {"stops": (stop(left_m=8.0),)},
        {"stops": (stop(yaw_rad=math.pi),)},
        {"stops": (stop(yaw_rad=math.pi / 2),)},
        {"stops": (stop(along_m=7.0),)},
        {"stops": (stop(along_m=110.0),)},
        {"stops": ()},
    ],
    ids=str,
)
def test_a_light_that_is_not_for_it_stops_nobody(changed: dict[str, Any]) -> None:
    assert lights_ahead(PATH, 5.0, shown(**changed), anchor=ANCHOR) == ()


class Drive:
    """The stand-in on a straight lane of the lot, 8 m/s once it is under way."""

    def __init__(self) -> None:
        self.source = StandinSource(PATH, read_parameters(None), vehicle_id="ego", anchor=ANCHOR)
        self.now_ns = START_STAMP_NS
        self.accel_mps2 = 0.0

    def go_on(self, seconds: float, lights: ShownLights | None = None) -> None:
        """Drive on, told every tenth of a second what lights show."""
        until_ns = self.now_ns + round(seconds * S)
        while self.now_ns < until_ns:
            if lights is not None:
                self.source.heed(replace(lights, stamp_ns=self.now_ns))
            self.now_ns = min(self.now_ns + S // 10, until_ns)
            for channel, message in self.source.advance(self.now_ns):
                if channel == "control":
                    self.accel_mps2 = message.accel_mps2

    def until(self, s_m: float) -> None:
        while self.source.s_m < s_m:
            self.go_on(0.02)


def test_it_stands_before_a_red_light_and_goes_on_at_green() -> None:
    drive = Drive()
    drive.go_on(30.0, shown())
    assert drive.source.speed_mps < 0.05
    assert STANDS_M - 1.6 < drive.source.s_m < STANDS_M + 0.1
    drive.go_on(3.0, shown(colour="green"))
    assert drive.source.s_m > STANDS_M + 1.0


def test_a_flipped_light_counts_from_the_next_control_tick_on() -> None:
    drive = Drive()
    drive.until(STANDS_M - 18.0)
    speed_mps, before_mps2 = drive.source.speed_mps, drive.accel_mps2
    assert speed_mps > 6.0
    drive.source.heed(shown(stamp_ns=drive.now_ns))
    drive.go_on(0.02)
    needed_mps2 = speed_mps**2 / (2.0 * 18.0)
    assert drive.accel_mps2 < before_mps2
    assert drive.accel_mps2 == pytest.approx(-needed_mps2, rel=0.1)


def test_who_cannot_stand_before_amber_in_comfort_drives_on() -> None:
    drive = Drive()
    drive.until(STANDS_M - 12.0)
    drive.go_on(2.0, shown(colour="amber"))
    assert drive.source.s_m > STANDS_M
    assert drive.source.speed_mps > 6.0


def test_a_light_of_which_nothing_is_heard_any_more_stops_nobody() -> None:
    drive = Drive()
    drive.go_on(20.0, shown())
    assert drive.source.speed_mps < 0.05
    drive.go_on(4.0)
    assert drive.source.s_m > STANDS_M + 1.0
