"""The log of a vehicle beside the car is read ahead, so far and no farther, and holds up nobody."""

from __future__ import annotations

import threading
import time
from collections import Counter
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest

from foretwin.contracts.anchor import Anchor, AnchorPose
from foretwin.contracts.drive import GnssFix, VehicleInfo, VehicleState
from foretwin.contracts.frames import GeoPoint, LocalFrame, geo_from_local, local_pose
from foretwin.orchestrator.other_vehicles import recorded
from foretwin.orchestrator.other_vehicles.recorded import RecordedVehicle
from foretwin.sim_worker.vehicle.parameters import load_vehicle
from foretwin.telemetry.logs.log import Log, Sample

START_NS = 1_700_000_000_000_000_000
CAR = load_vehicle(None)
INFO = VehicleInfo(
    vehicle_id="x", time_base="utc", start_stamp_ns=START_NS, body_from_antenna_m=(0.0, 0.0, 0.0)
)
FRAME = LocalFrame(GeoPoint(52.5, 13.4))
DEADLINE_S = 30.0


def samples(count: int) -> Iterator[Sample]:
    """Positions, ten a second, of who drives east at 10 m/s."""
    for k in range(count):
        lat, lon = geo_from_local(FRAME, np.array([float(k), 0.0])).tolist()
        yield "gnss", GnssFix(stamp_ns=START_NS + k * 10**8, position=GeoPoint(lat, lon))


def own(t_s: float) -> VehicleState:
    return VehicleState(
        vehicle_id="ego", stamp_ns=START_NS + round(t_s * 1e9), position=GeoPoint(52.5, 13.4),
        yaw_rad=0.0, speed_mps=8.0, yaw_rate_radps=0.0, accel_mps2=0.0,
    )  # fmt: skip


class Ground:
    """A log that a test plays, and what is told of it."""

    def __init__(self) -> None:
        self.told: list[str] = []
        self.opened: list[RecordedVehicle] = []
        self.read: Callable[[], Iterator[Sample]] = lambda: samples(100)

    def open(self, *, waits: bool, lot: Anchor | None = None) -> RecordedVehicle:
        log = RecordedVehicle(
            Path("van.mcap"), "van", CAR, own=INFO, offset_s=None, waits=waits, lot=lot,
            tell=lambda told: self.told.append(told.text),
        )  # fmt: skip
        self.opened.append(log)
        return log


@pytest.fixture
def ground(monkeypatch: pytest.MonkeyPatch) -> Iterator[Ground]:
    found = Ground()

    def read(_skipped: Counter[str]) -> Iterator[Sample]:
        return found.read()

    monkeypatch.setattr(recorded, "open_log", lambda _: Log(info=INFO, read=read))
    yield found
    for log in found.opened:
        log.close()


def wait_until(condition: Callable[[], bool]) -> None:
    deadline = time.monotonic() + DEADLINE_S
    while not condition():
        assert time.monotonic() < deadline
        threading.Event().wait(0.002)


def stamps_s(log: RecordedVehicle, until_s: float) -> list[float]:
    return [(one.state.stamp_ns - START_NS) / 1e9 for one in log.states_until(own(until_s))]


def test_a_reader_that_hangs_holds_up_no_live_drive(ground: Ground) -> None:
    goes_on = threading.Event()

    def slow() -> Iterator[Sample]:
        for k, sample in enumerate(samples(100)):
            if k == 20:
                goes_on.wait()
            yield sample

    ground.read = slow
    log = ground.open(waits=False)
    heard: list[float] = []

    def hears(until_s: float, newest_s: float) -> bool:
        heard.extend(stamps_s(log, until_s))
        return bool(heard) and heard[-1] >= newest_s

    # Of 20 positions that the reader gives before it hangs, the last waits for what else its
    # instant holds, and the one before to be passed on.
    wait_until(lambda: hears(2.5, 1.7))
    assert stamps_s(log, 9.0) == []
    assert ground.told == ["van.mcap of van is read too slowly: its states come late"]
    goes_on.set()
    wait_until(lambda: hears(9.0, 9.0))
    assert heard == sorted(heard)
    assert len(ground.told) == 1


def test_in_lock_step_the_drive_waits_for_what_is_to_come(ground: Ground) -> None:
    steps = threading.Semaphore(0)

    def stepwise() -> Iterator[Sample]:
        for sample in samples(50):
            assert steps.acquire(timeout=DEADLINE_S)
            yield sample

    ground.read = stepwise
    log = ground.open(waits=True)
    slowly = threading.Thread(target=lambda: [steps.release() for _ in range(50)])
    slowly.start()
    in_steps = [stamps_s(log, t / 4) for t in range(1, 20)]
    slowly.join()
    ground.read = lambda: samples(50)
    at_once = ground.open(waits=True)
    assert in_steps == [stamps_s(at_once, t / 4) for t in range(1, 20)]
    assert sum(map(len, in_steps)) > 40
    assert ground.told == []


def test_no_more_is_read_ahead_than_fits(ground: Ground, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(recorded, "AHEAD_SAMPLES", 16)
    given = Counter[str]()

    def counted() -> Iterator[Sample]:
        for sample in samples(100):
            given["read"] += 1
            yield sample

    ground.read = counted
    log = ground.open(waits=True)
    assert stamps_s(log, 1.0)[-1] == 1.0
    # Of what was taken: 11, and the next, which waits. In hand: 16, one at the door, one looked at.
    assert given["read"] <= 12 + 16 + 2
    assert stamps_s(log, 9.9)[-1] == pytest.approx(9.9)


@pytest.mark.parametrize("waits", [True, False])
def test_a_log_that_breaks_off_is_told_of_and_the_drive_goes_on(
    ground: Ground, waits: bool
) -> None:
    def broken() -> Iterator[Sample]:
        yield from samples(10)
        raise OSError("the disk is gone")

    ground.read = broken
    log = ground.open(waits=waits)

    def told() -> bool:
        stamps_s(log, 5.0)
        return "van.mcap of van cannot be read on: OSError: the disk is gone" in ground.told

    wait_until(told)
    assert stamps_s(log, 9.0) == []


def test_a_log_that_is_closed_early_leaves_no_thread(ground: Ground) -> None:
    before = threading.active_count()
    ground.read = lambda: samples(100_000)
    log = ground.open(waits=True)
    stamps_s(log, 1.0)
    log.close()
    log.close()
    assert threading.active_count() == before


def test_a_vehicle_that_drove_on_a_lot_is_where_that_is_in_the_world(ground: Ground) -> None:
    lot = AnchorPose(lat_deg=52.5, lon_deg=13.4, yaw_deg=0.0)
    world = AnchorPose(lat_deg=48.0, lon_deg=11.0, yaw_deg=90.0)
    log = ground.open(waits=True, lot=Anchor(lot=lot, world=world, scale=2.0))
    state = log.states_until(own(5.0))[-1].state
    x_m, y_m, yaw_rad = local_pose(world.frame, state.position, state.yaw_rad)
    # East on the lot is north in the World, where 50 m are 100.
    assert (x_m, y_m) == pytest.approx((0.0, 100.0), abs=1.0)
    assert yaw_rad == pytest.approx(np.pi / 2, abs=0.05)
    assert state.speed_mps == pytest.approx(20.0, abs=1.0)
