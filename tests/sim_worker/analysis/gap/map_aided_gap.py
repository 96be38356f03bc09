"""What the gap between model and car becomes where a map helps to find the car.

    python -m tests.sim_worker.analysis.gap.map_aided_gap [SEEDS]

The stand-in car drives 150 s through a drawn town with a telephone's positions; the gap of the same
free runs is measured from states without a map, and with one.
"""

from __future__ import annotations

import sys
from typing import NamedTuple

import numpy as np

from foretwin.sim_worker.analysis.gap.errors import GapLimits, GapMeter
from foretwin.sim_worker.analysis.gap.free_run import FreeRunner
from foretwin.sim_worker.analysis.gap.measured_motion import motion_on_grid
from foretwin.sim_worker.analysis.motion_record import MotionRecorder
from foretwin.sim_worker.vehicle.parameters import load_vehicle
from foretwin.telemetry.estimator.motion_track import MotionTrack
from foretwin.telemetry.standin.source import START_STAMP_NS
from tests.telemetry.city_drive import phone_positions
from tests.telemetry.phone_figures import town_drive, town_streets
from tests.telemetry.standin_drive import FRAME
from tests.telemetry.town_map import seer

DURATION_S = 150.0
HORIZON_S = 2.0


class Gap(NamedTuple):
    """RMS of the gap after 2 s, and how often a limit was exceeded."""

    across_m: float
    along_m: float
    alarms: int


def measured_gap(*, seed: int, mapped: bool) -> Gap:
    drive = town_drive(1, DURATION_S)
    roads = seer(town_streets(1, DURATION_S).legs, seed=seed) if mapped else None
    track = MotionTrack(drive.source.info, steering=drive.source.steering)
    recorder, states, due_ns = MotionRecorder(frame=FRAME, keep_s=1e6, depth=200_000), [], 0
    for channel, message in phone_positions(drive, seed=100 + seed):
        recorder.handle(channel, message)
        track.take(channel, message)
        if not track.started or message.stamp_ns < due_ns:
            continue
        due_ns = message.stamp_ns + 50_000_000
        states.append(track.state(message.stamp_ns))
        line = None if roads is None else roads.line(states[-1])
        if line is not None:
            track.take("map", line)
    assert states[-1].stamp_ns > START_STAMP_NS + 0.9 * DURATION_S * 1e9
    record = recorder.record()
    motion = motion_on_grid(states, record.stamp_ns, frame=FRAME)
    meter = GapMeter(FreeRunner(load_vehicle()), vehicle_id="standin")
    samples = meter.samples(record, motion, horizons_s=(HORIZON_S,))
    limits = GapLimits()
    alarms = sum(alarm.over for sample in samples for alarm in limits.handle(sample))
    across, along = (
        np.array([getattr(sample, name) for sample in samples]) for name in ("across_m", "along_m")
    )
    return Gap(float(np.sqrt(np.mean(across**2))), float(np.sqrt(np.mean(along**2))), alarms)


def main(arguments: list[str]) -> int:
    """Print the gap after 2 s without and with a map."""
    for seed in range(int(arguments[0]) if arguments else 3):
        for mapped in (False, True):
            gap = measured_gap(seed=seed, mapped=mapped)
            print(
                f"seed {seed} {'with' if mapped else 'without'} map: across {gap.across_m:.2f} m, "
                f"along {gap.along_m:.2f} m (RMS after 2 s), {gap.alarms} alarms",
                flush=True,
            )
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
