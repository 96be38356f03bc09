"""The car's clock steps back: the estimator goes on, and so does the mirror behind it."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from foretwin.contracts.bus import Mailbox, Received
from foretwin.contracts.drive import (
    ControlCommand,
    GnssFix,
    HeadingSample,
    SpeedSample,
    VehicleInfo,
)
from foretwin.contracts.frames import GeoPoint, geo_from_local
from foretwin.contracts.setup import BusSetup, WorkerSetup
from foretwin.contracts.simulation import MirrorSample
from foretwin.sim_worker.mirror.process import MirrorWorker
from foretwin.sim_worker.vehicle.parameters import load_vehicle
from foretwin.telemetry.estimator.estimator import StateEstimator
from tests.contracts.memory_bus import MemoryBus
from tests.sim_worker.places import FRAME

S = 1_000_000_000
HOUR_NS = 3600 * S
START_NS = 1_700_000_000 * S
STEP_AT_S, END_S = 6.0, 14.0
SPEED_MPS, RADIUS_M = 8.0, 40.0
CAR = load_vehicle()


class Drive:
    """A car on a circle whose clock goes back by an hour; a mirror hears its states."""

    def __init__(self, folder: Path, *, lossless: bool, with_receipt: bool) -> None:
        self.bus = MemoryBus()
        self._inbox, self._out = Mailbox(1000), Mailbox(1000)
        for channel in ("state", "control"):
            self.bus.subscribe(channel, self._inbox, vehicle="ego")
        self.bus.subscribe("mirror", self._out, run="r")
        setup = WorkerSetup(
            run_id="r",
            process_id="mirror",
            vehicle_id="ego",
            log_file=str(folder / "log.jsonl"),
            bus=BusSetup(endpoint="tcp/127.0.0.1:1", lossless=lossless),
            role="mirror",
            worlds_dir=str(folder),
            vehicle=CAR,
            drive_frame=FRAME,
            commands_recorded=True,
        )
        self._mirror = MirrorWorker(setup, self.bus)
        sends = ("gnss", "speed", "heading")
        self._estimator = StateEstimator(
            VehicleInfo(vehicle_id="ego", time_base="utc", start_stamp_ns=START_NS, sends=sends)
        )
        self._with_receipt = with_receipt

    def samples(self) -> list[tuple[float, MirrorSample]]:
        """Return the mirror's samples and when, in true time, they came."""
        found = []
        for k in range(round(END_S * 50)):
            time_s = k / 50
            self._hear(time_s)
            while (item := self._inbox.take()) is not None:
                assert isinstance(item, Received)
                self._mirror.handle(item)
            while (item := self._out.take()) is not None:
                found.append((time_s, item.message()))
        return found

    def _hear(self, time_s: float) -> None:
        stamp_ns = START_NS + round(time_s * S) - (HOUR_NS if time_s >= STEP_AT_S else 0)
        angle = SPEED_MPS * time_s / RADIUS_M
        at = RADIUS_M * np.array([math.sin(angle), 1.0 - math.cos(angle)])
        lat, lon = (float(degrees) for degrees in geo_from_local(FRAME, at))
        command = ControlCommand(
            stamp_ns=stamp_ns, accel_mps2=0.0, tire_angle_rad=math.atan(CAR.wheelbase_m.value / 40)
        )
        self.bus.publish("control", command, vehicle="ego")
        for channel, message in (
            ("speed", SpeedSample(stamp_ns=stamp_ns, speed_mps=SPEED_MPS)),
            ("heading", HeadingSample(stamp_ns=stamp_ns, yaw_rad=angle)),
            ("gnss", GnssFix(stamp_ns=stamp_ns, position=GeoPoint(lat, lon), std_m=0.02)),
        ):
            received_ns = 7 * S + round(time_s * S) if self._with_receipt else None
            state = self._estimator.handle(channel, message, received_ns=received_ns)
            if state is not None:
                self.bus.publish("state", state, vehicle="ego")


@pytest.mark.parametrize("lossless", [False, True])
@pytest.mark.parametrize("with_receipt", [False, True])
def test_the_twin_drives_on_after_the_cars_clock_went_back(
    tmp_path: Path, lossless: bool, with_receipt: bool
) -> None:
    found = Drive(tmp_path, lossless=lossless, with_receipt=with_receipt).samples()
    before = [sample for time_s, sample in found if time_s < STEP_AT_S]
    after = [(time_s, sample) for time_s, sample in found if time_s >= STEP_AT_S]
    assert len(before) > 50
    new_clock = [(t, sample) for t, sample in after if sample.stamp_ns < START_NS]
    assert len(new_clock) > 60
    # A second until the new clock is believed, and a tenth until the next sample is due.
    assert new_clock[0][0] - STEP_AT_S < 1.2
    for time_s, sample in new_clock:
        assert sample.stamp_ns == pytest.approx(START_NS - HOUR_NS + time_s * S, abs=0.05 * S)
        angle = SPEED_MPS * time_s / RADIUS_M
        place = (RADIUS_M * math.sin(angle), RADIUS_M * (1.0 - math.cos(angle)))
        assert math.dist((sample.real.x_m, sample.real.y_m), place) < 0.5
        assert sample.gap_m < 1.5
    stamps = [sample.stamp_ns for _, sample in new_clock]
    assert stamps == sorted(set(stamps))
    assert new_clock[-1][1].independent
