"""What of a drive is laid beside its model: a car at full lock tells nothing of either."""

from __future__ import annotations

import math

import numpy as np

from foretwin.contracts.frames import geo_from_local
from foretwin.sim_worker.analysis.gap.free_run import FreeRunner
from foretwin.sim_worker.analysis.gap.pairs import pairs_of
from foretwin.sim_worker.analysis.gap.verdict import FaultDetector
from foretwin.sim_worker.analysis.motion_record import MotionRecorder
from foretwin.telemetry.standin.parameters import read_parameters
from foretwin.telemetry.standin.path import DrivenPath
from foretwin.telemetry.standin.source import START_STAMP_NS, StandinSource
from tests.sim_worker.analysis.gap.judging_faults import verdicts_on
from tests.sim_worker.faulty_standin import FaultyDrive, model_with
from tests.telemetry.standin_drive import FRAME

COVERS = ("foretwin.sim_worker.analysis.gap.push_blocks",)

_RADIUS_M, _LEG_M = 4.4, 40.0


def turning_back(*, end_s: float = 34.0) -> FaultyDrive:
    """A sound car that drives up and down a road, and turns at its ends at full lock."""
    x, y, yaw = 0.0, 0.0, 0.0
    points = [(x, y)]
    for _ in range(6):
        for length, curvature in ((_LEG_M, 0.0), (math.pi * _RADIUS_M, 1.0 / _RADIUS_M)):
            for _ in range(round(2.0 * length)):
                step = length / round(2.0 * length)
                x += step * math.cos(yaw + 0.5 * step * curvature)
                y += step * math.sin(yaw + 0.5 * step * curvature)
                yaw += step * curvature
                points.append((x, y))
    geo = geo_from_local(FRAME, np.array(points))
    parameters = read_parameters()
    path = DrivenPath(geo[:, 0], geo[:, 1], np.full(len(points), 8.0), driver=parameters.driver)
    source = StandinSource(path, parameters, vehicle_id="standin", seed=1, end_s=end_s)
    samples = list(source.advance(START_STAMP_NS + round(end_s * 1e9)))
    return FaultyDrive(source.info, samples)


def test_what_is_driven_at_full_lock_is_in_no_pair() -> None:
    """With it the model's turning lagged 0.22 s behind the car's, surely: its `inertia`."""
    drive, model = turning_back(end_s=16.0), model_with(None)
    recorder = MotionRecorder(frame=FRAME)
    for channel, message in drive.samples:
        recorder.handle(channel, message)
    record = recorder.record(START_STAMP_NS + 2 * 10**9, START_STAMP_NS + 15 * 10**9)
    pairs = pairs_of(record, FreeRunner(model))
    locked = np.abs(record.yaw_rate_radps) > 0.45 * np.maximum(record.speed_mps, 2.5) / 2.6
    assert locked.sum() > 50
    assert not np.isfinite(pairs.curvature_pm[locked]).any()
    assert not pairs.excited[locked].any()
    assert np.isfinite(pairs.curvature_pm).sum() > 100
    assert pairs.excited.any()


def test_a_sound_car_that_turns_at_full_lock_is_not_accused() -> None:
    """Scrubbing tyres took 0.6 of 0.9 m/s²: `drive_gain`, the car's; and the model's `inertia`."""
    drive = turning_back()
    detector = FaultDetector(drive.info, model_with(None), frame=FRAME)
    assert [verdict.cause for verdict in verdicts_on(detector, drive)] == []
