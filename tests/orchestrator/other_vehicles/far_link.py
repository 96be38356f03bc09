"""Two cars on lots of their own behind bad links: the real estimators and feed, without processes.

Each car stamps by a clock of its own, on its own lot; samples are lost, late and jittered, and
so are questions and answers. Everything is drawn by a seed.
"""

from __future__ import annotations

import heapq
import itertools
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import msgspec
import numpy as np

from foretwin.contracts.anchor import Anchor, AnchorPose
from foretwin.contracts.codec import encode
from foretwin.contracts.drive import (
    GnssFix,
    ImuSample,
    SpeedSample,
    VehicleInfo,
    VehicleTime,
)
from foretwin.contracts.frames import GeoPoint, LocalFrame, geo_pose
from foretwin.contracts.keys import CHANNELS, key
from foretwin.contracts.mailbox import Mailbox, Received, Reply
from foretwin.contracts.roles import VehicleEncounter
from foretwin.contracts.vehicle import VehicleParameters
from foretwin.orchestrator.config import OtherVehicleConfig
from foretwin.orchestrator.context import DriveContext
from foretwin.orchestrator.other_vehicles.vehicles import OtherVehicleFeed
from foretwin.orchestrator.plan import OtherVehiclePlan
from foretwin.telemetry.anchored import world_from_lot_message
from foretwin.telemetry.estimator.estimator import estimator_of
from tests.contracts.memory_bus import MemoryBus
from tests.orchestrator.other_vehicles.two_cars import Drive
from tests.orchestrator.trip import town_plan

FRAME = LocalFrame(GeoPoint(52.5, 13.4))
BEGINS_S, ENDS_S = -6.0, 8.0
"""Cars drive for a while before they meet: estimators and clocks have to settle."""
MONO_NS = 50_000_000_000_000
_GNSS_STD_M, _SPEED_STD_MPS, _GYRO_STD_RADPS, _ACCEL_STD_MPS2 = 0.02, 0.03, 0.002, 0.05
"""As of the stand-in car."""


class Link(NamedTuple):
    """One way: delay, even jitter on top of it, and how many of a hundred are lost."""

    delay_s: float
    jitter_s: float
    loss: float

    def arrival_s(self, sent_s: float, random: np.random.Generator) -> float | None:
        """Return when something arrives, None where it is lost."""
        lost, late_s = random.random() < self.loss, self.jitter_s * random.random()
        return None if lost else sent_s + self.delay_s + late_s


class FarCar(NamedTuple):
    """A car on its lot: `drive` is where it is in the World, its clock is `ahead_s` of the true."""

    vehicle_id: str
    drive: Drive
    vehicle: VehicleParameters
    anchor: Anchor
    link: Link
    ahead_s: float
    fast_ppm: float

    def stamp_ns(self, at_s: float) -> int:
        """Return what its clock shows at a true time."""
        return 1_700_000_000_000_000_000 + round(
            (at_s * (1.0 + 1e-6 * self.fast_ppm) + self.ahead_s) * 1e9
        )

    def samples(self, random: np.random.Generator) -> Iterator[tuple[float, str, Any]]:
        """Yield what it measures on its lot, with errors, by true time."""
        for k in range(round((ENDS_S - BEGINS_S) * 100)):
            at_s = BEGINS_S + k / 100.0
            time_s = np.array([at_s])
            speed = float(self.drive.speeds(time_s)[0])
            ns = self.stamp_ns(at_s)
            if k % 2 == 0:
                rate = speed * self.drive.curvature_pm + random.normal(0.0, _GYRO_STD_RADPS)
                accel = float(self.drive.accels(time_s)[0]) + random.normal(0.0, _ACCEL_STD_MPS2)
                yield (
                    at_s,
                    "imu",
                    ImuSample(
                        stamp_ns=ns,
                        accel_mps2=(accel, speed * rate, 9.81),
                        rate_radps=(0.0, 0.0, rate),
                    ),
                )
                measured = speed + random.normal(0.0, _SPEED_STD_MPS)
                yield at_s, "speed", SpeedSample(stamp_ns=ns, speed_mps=measured)
            if k % 10 == 0:
                x, y, yaw = self.drive.poses(time_s)[0].tolist()
                noise = random.normal(0.0, _GNSS_STD_M, 2)
                there = geo_pose(FRAME, x + noise[0], y + noise[1], yaw)
                lot = self.anchor.lot_from_world(there.position, there.yaw_rad)
                yield at_s, "gnss", GnssFix(stamp_ns=ns, position=lot.position, std_m=_GNSS_STD_M)


def lot(lat_deg: float, lon_deg: float, yaw_deg: float) -> Anchor:
    """An anchor between a lot and the middle of the crossing."""
    at = AnchorPose(lat_deg=52.5, lon_deg=13.4, yaw_deg=0.0)
    return Anchor(lot=AnchorPose(lat_deg=lat_deg, lon_deg=lon_deg, yaw_deg=yaw_deg), world=at)


class _Kept:
    def __init__(self) -> None:
        self.rows: list[dict[str, Any]] = []

    def add(self, table: str, rows: list[dict[str, Any]]) -> None:
        assert table == "encounters"
        self.rows += rows


class _AskingBus(MemoryBus):
    """Passes questions for the time on to the cars; nothing else is heard."""

    def __init__(self) -> None:
        super().__init__()
        self.asked: list[tuple[str, int]] = []

    def publish(self, channel: str, message: msgspec.Struct, **ids: str) -> None: ...

    def request(self, channel: str, message: msgspec.Struct, *_: Any, **ids: Any) -> None:
        if channel == "vehicle_clock":
            self.asked.append(ids["tag"])


class Judged(NamedTuple):
    """What became of an encounter, and what was found of the other's clock."""

    encounters: list[VehicleEncounter]
    clocks: dict[str, Any]


def judged(own: FarCar, other: FarCar, *, folder: Path, seed: int, answers: bool = True) -> Judged:
    """Let both drive, and return what the feed of the first one's drive makes of it."""
    random = np.random.default_rng(seed)
    config = OtherVehicleConfig(id=other.vehicle_id, live=True)
    member = OtherVehiclePlan(config, other.vehicle, commands_recorded=False)
    plan = replace(town_plan(folder), vehicle=own.vehicle, beside=(member,), drive_frame=FRAME)
    bus, tables = _AskingBus(), _Kept()
    told: Any = lambda notice: None  # noqa: E731
    context = DriveContext(plan, bus, Mailbox(8), tables, told)  # type: ignore[arg-type]
    infos = {
        car.vehicle_id: VehicleInfo(
            vehicle_id=car.vehicle_id, time_base="utc", start_stamp_ns=car.stamp_ns(BEGINS_S),
            body_from_antenna_m=(0.0, 0.0, 0.0), sends=("gnss", "imu", "speed"),
        )
        for car in (own, other)
    }  # fmt: skip
    estimator = estimator_of(infos[own.vehicle_id], own.vehicle)
    feed = OtherVehicleFeed(context, lambda: estimator.clock_offset_ns)
    feed.begin(infos[own.vehicle_id])
    queue: list[tuple[float, int, FarCar, str, Any]] = []
    numbers = itertools.count()
    for car in (own, other):
        for at_s, channel, message in car.samples(random):
            arrival_s = car.link.arrival_s(at_s, random)
            if arrival_s is not None:
                sent = world_from_lot_message(car.anchor, message)
                heapq.heappush(queue, (arrival_s, next(numbers), car, channel, sent))
    cars = {car.vehicle_id: car for car in (own, other)}
    introduced = False
    while queue:
        now_s, _, car, channel, message = heapq.heappop(queue)
        mono_ns = MONO_NS + round(now_s * 1e9)
        if channel == "vehicle_clock":
            asked, stamp = message
            answer = VehicleTime(stamp_ns=stamp)
            feed.take_time(Reply("vehicle_clock", asked, answer, None, mono_ns))
        elif car is own:
            state = estimator.handle(channel, message, received_ns=mono_ns)
            if state is not None:
                feed.keep_up_with(state, None, {own.vehicle_id: "all"})
        else:
            full_key = key(channel, vehicle=other.vehicle_id)
            item = Received(channel, full_key, encode(message), CHANNELS[channel].kind)
            item.received_mono_ns = mono_ns
            feed.take_sample(other.vehicle_id, item)
            if not introduced:
                introduced = True
                feed.take_info(other.vehicle_id, infos[other.vehicle_id])
        feed.look(mono_ns / 1e9)
        for name, asked_ns in bus.asked:
            there_s = cars[name].link.arrival_s(now_s, random)
            back_s = None if there_s is None else cars[name].link.arrival_s(there_s, random)
            if answers and there_s is not None and back_s is not None:
                said = (name, asked_ns), cars[name].stamp_ns(there_s)
                heapq.heappush(queue, (back_s, next(numbers), cars[name], "vehicle_clock", said))
        bus.asked.clear()
    feed.close()
    encounters = [msgspec.convert(row, VehicleEncounter) for row in tables.rows]
    return Judged(encounters, feed.clocks())
