"""The model at measured steering and speed against the gyro, drive by drive.

    python -m tests.sim_worker.analysis.gap.measured_figures standin 300 320
    python -m tests.sim_worker.analysis.gap.measured_figures LOG[:FROM_S[:TO_S]] ...

`standin` drives the stand-in car on ways of its own without recorded commands, its steering, speed
and gyro stamped late by known times; recorded drives may be cut.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Iterable
from pathlib import Path
from typing import Any, NamedTuple

import msgspec
import numpy as np

from foretwin.contracts.drive import GnssFix, ImuSample, SpeedSample, SteeringSample
from foretwin.contracts.frames import LocalFrame
from foretwin.contracts.vehicle import VehicleParameters
from foretwin.sim_worker.analysis.gap.clock_offsets import ClockOffset
from foretwin.sim_worker.analysis.gap.measured_turning import NotHeld, TurningGap, turning_gap
from foretwin.sim_worker.analysis.motion_record import MotionRecorder
from foretwin.sim_worker.vehicle.parameters import load_vehicle
from foretwin.telemetry.logs.opening import open_log
from tests.sim_worker.faulty_standin import drive_of

DURATION_S = 90.0
_SURE = 1.96


class Lateness(NamedTuple):
    """By how much samples are stamped late, and what the gyro shows at rest."""

    steering_s: float = 0.0
    speed_s: float = 0.0
    gyro_s: float = 0.0
    bias_radps: float = 0.0
    position_s: float = 0.0


def hand_driven(seed: int, late: Lateness, *, end_s: float = DURATION_S) -> list[tuple[str, Any]]:
    """Return the stand-in's samples on one of its ways as a car driven by hand would send them."""
    return [
        (channel, _stamped(message, late))
        for channel, message in drive_of(seed, end_s=end_s).samples
        if channel not in ("control", "plan")
    ]


def _stamped(message: Any, late: Lateness) -> Any:
    late_s = 0.0
    if isinstance(message, SteeringSample):
        late_s = late.steering_s
    elif isinstance(message, SpeedSample):
        late_s = late.speed_s
    elif isinstance(message, GnssFix):
        late_s = late.position_s
    elif isinstance(message, ImuSample):
        x, y, z = message.rate_radps
        message = msgspec.structs.replace(message, rate_radps=(x, y, z + late.bias_radps))
        late_s = late.gyro_s
    return msgspec.structs.replace(message, stamp_ns=message.stamp_ns + round(late_s * 1e9))


def turning_of(
    samples: Iterable[tuple[str, Any]], vehicle: VehicleParameters | None = None
) -> TurningGap | NotHeld:
    """Return what the samples of a drive say of the model's turning."""
    kept = list(samples)
    place = next(m.position for _, m in kept if isinstance(m, GnssFix))
    recorder = MotionRecorder(frame=LocalFrame(place), keep_s=1e6, depth=len(kept) + 1)
    for channel, message in kept:
        recorder.handle(channel, message)
    return turning_gap(recorder.record(), vehicle or load_vehicle())


def _line(name: str, gap: TurningGap) -> str:
    full = np.degrees(2.0 * gap.half_width_radps)
    rms = math.degrees(float(np.sqrt(np.mean(gap.error_radps**2))))
    return (
        f"{name:<28} {len(full):>4} s within {gap.within:.1%}, full width median "
        f"{np.median(full):.2f}, "
        f"mean {full.mean():.2f}, widest {full.max():.2f} °/s, RMS {rms:.2f} °/s, steering "
        f"{_clock(gap.steering_clock)}, speed {_clock(gap.speed_clock)}, positions "
        f"{_clock(gap.position_clock)}, gain {gap.gain:.3f} ± "
        f"{gap.gain_half:.3f}, zero {math.degrees(gap.steering_offset_rad):+.2f} ± "
        f"{math.degrees(gap.steering_offset_half_rad):.2f}°"
    )


def _clock(clock: ClockOffset | None) -> str:
    return (
        "-" if clock is None else f"{1e3 * clock.late_s:+.0f} ± {_SURE * 1e3 * clock.std_s:.0f} ms"
    )


def print_standins(seeds: range) -> None:
    """Print a line for each way, and how many of the known times are within what is said."""
    held = [0, 0]
    within: list[float] = []
    counted = 0
    for seed in seeds:
        steering_s, speed_s, gyro_s = np.random.default_rng(seed).uniform(0.0, 0.3, 3)
        gap = turning_of(hand_driven(seed, Lateness(steering_s, speed_s, gyro_s, 0.01)))
        if isinstance(gap, NotHeld):
            print(f"seed {seed}: {gap.why}", flush=True)
            continue
        counted += 1
        within.append(gap.within)
        known = ((gap.steering_clock, steering_s), (gap.speed_clock, speed_s))
        for place, (clock, late_s) in enumerate(known):
            held[place] += clock is not None and (
                abs(clock.late_s - (late_s - gyro_s)) <= _SURE * clock.std_s
            )
        print(_line(f"seed {seed}", gap), f"(true {1e3 * (steering_s - gyro_s):+.0f}, ", end="")
        print(f"{1e3 * (speed_s - gyro_s):+.0f} ms)", flush=True)
    print(
        f"{counted} ways: {np.mean(within):.1%} of seconds within; the true lateness is in the "
        f"interval of steering {held[0]}, of speed {held[1]} times"
    )


def print_logs(words: Iterable[str]) -> None:
    """Print a line for each recorded drive, or for the part of it that is asked for."""
    for word in words:
        name, *cut = word.split(":")
        from_s, to_s = (float(cut[k]) if len(cut) > k else (0.0, math.inf)[k] for k in (0, 1))
        samples = list(open_log(Path(name)).samples())
        start_ns = samples[0][1].stamp_ns  # type: ignore[attr-defined]
        part = [
            one
            for one in samples
            if from_s <= (one[1].stamp_ns - start_ns) * 1e-9 < to_s  # type: ignore[attr-defined]
        ]
        gap = turning_of(part)
        if isinstance(gap, NotHeld):
            print(f"{word}: {gap.why}", flush=True)
            continue
        print(_line("/".join(Path(name).parts[-2:]), gap), flush=True)


def main(words: list[str]) -> None:
    """Print what was asked for."""
    match words:
        case ["standin", first, end]:
            print_standins(range(int(first), int(end)))
        case [_, *_]:
            print_logs(words)
        case _:
            print(__doc__)


if __name__ == "__main__":
    main(sys.argv[1:])
