"""What is wrong with the telemetry that comes in: said once, not with every sample."""

from __future__ import annotations

from collections import Counter
from typing import Any

from foretwin.telemetry.estimator.estimator import ClockReport, StateEstimator
from foretwin.telemetry.estimator.mounting import Learnt
from foretwin.telemetry.estimator.reported_state import StateConsistency

REARM_NS = 5_000_000_000
"""A channel that was overdue must have come for this long before it is named once more."""

_LIKELY = {
    "imu": "is its z axis up, are its yaw rates in rad/s, to the left positive?",
    "steering": "is its angle in rad, to the left positive?",
    "speed": "is it in m/s, forwards positive?",
    "forces": "is the imu's x axis ahead, are its accelerations in m/s², to the front positive?",
    "heading": "is it in rad, counter-clockwise from east?",
}


class TelemetryWatch:
    """Turns overdue channels, steps of the clock and samples of a wrong type into warnings.

    Times are of the vehicle's clock, without its steps, or of the receiver's: any one that rises.
    """

    def __init__(self) -> None:
        self.stale: Counter[str] = Counter()
        """How often each channel fell silent."""
        self._overdue_until_ns: dict[str, int] = {}
        self._silent: tuple[str, ...] = ()
        self._steps = 0
        self._wrong: set[str] = set()
        self._left_out: set[str] = set()

    def overdue(self, channels: tuple[str, ...], now_ns: int) -> list[str]:
        """Take which channels are overdue now; return a warning of those that are so newly."""
        newly = []
        for channel in channels:
            if channel not in self._silent:
                self.stale[channel] += 1
            before_ns = self._overdue_until_ns.get(channel)
            self._overdue_until_ns[channel] = now_ns
            if before_ns is None or now_ns - before_ns > REARM_NS:
                newly.append(channel)
        self._silent = channels
        if not newly:
            return []
        # What is wrong stands first: the display has one line, and the names may not fit there.
        return [f"telemetry overdue: {', '.join(newly)}; states go on without"]

    def estimator(self, estimator: StateEstimator) -> list[str]:
        """Return a warning for each new step of the clock, each channel of a wrong type, and each
        that tells of another motion than positions."""
        steps = estimator.clock.steps if estimator.clock_steps > self._steps else ()
        warnings = [
            f"telemetry: the vehicle's clock stepped by {step.step_ns * 1e-9:+z.3f} s "
            f"({step.channel}); its new time counts from here"
            for step in steps[self._steps :]
        ]
        self._steps = estimator.clock_steps
        for reason in estimator.refused:
            if reason.endswith("_wrong_type") and reason not in self._wrong:
                self._wrong.add(reason)
                channel = reason.removesuffix("_wrong_type")
                warnings.append(f"telemetry: {channel} carries messages of another type; refused")
        for channel in sorted(estimator.left_out - self._left_out):
            self._left_out.add(channel)
            warnings.append(
                f"telemetry: {channel} does not go with positions: left out until it does; "
                f"{_LIKELY[channel]}"
            )
        return warnings


def record(
    estimator: StateEstimator | None, watch: TelemetryWatch, *, receiver_utc_ns: int
) -> dict[str, Any]:
    """Return what run.json's `telemetry` says of clock, order and silence.

    `receiver_utc_ns` is the receiver's UTC when its monotonic clock read 0. Of the clock all is
    None where samples were taken in order, without times of receipt.
    """
    clock = ClockReport(None, None, None, ()) if estimator is None else estimator.clock
    late: Counter[str] = Counter() if estimator is None else estimator.late
    doubled: Counter[str] = Counter() if estimator is None else estimator.doubled
    offset_ns = None if clock.offset_ns is None else clock.offset_ns + receiver_utc_ns
    return {
        "late": late.total(),
        "doubled": doubled.total(),
        "stale": dict(sorted(watch.stale.items())),
        "clock_offset_ms": None if offset_ns is None else round(offset_ns * 1e-6, 3),
        "clock_drift_ppm": None if clock.drift_ppm is None else round(clock.drift_ppm, 2),
        "delay_spread_ms_p95": None if clock.spread_s is None else round(clock.spread_s * 1e3, 3),
        "clock_steps_s": [round(step.step_ns * 1e-9, 3) for step in clock.steps],
        "estimate": None if estimator is None else estimate_object(estimator.consistency),
    }


def estimate_object(found: StateConsistency) -> dict[str, Any]:
    """Return as JSON how far the states can be trusted; an honest share within is 0.95."""
    return {
        "within_95": {
            channel: {"share": round(float(one.within / one.taken), 4), "count": one.taken}
            for channel, one in found.surprises.items()
        },
        "spreads_widened": round(float(found.widened), 3),
        "spreads_stretched": {
            name: round(float(by), 3) for name, by in found.stretched._asdict().items()
        },
        "position_noise_m": None
        if found.position_noise_m is None
        else round(float(found.position_noise_m), 3),
        "receiver_slips": found.slips,
        "antenna_forward_m": _learnt(found.mounting.antenna_forward_m),
        "antenna_left_m": _learnt(found.mounting.antenna_left_m),
        "fixes_late_s": _learnt(found.mounting.fixes_late_s),
    }


def _learnt(one: Learnt) -> dict[str, float] | None:
    """Return a value and its spread, None where the drive does not tell of it."""
    if not one.observable:
        return None
    return {"value": round(float(one.value), 4), "std": round(float(one.std), 4)}


def estimate_line(found: StateConsistency) -> str:
    """Return in one line how far the states can be trusted."""
    shares = ", ".join(
        f"{channel} {100.0 * one.within / one.taken:.0f} %"
        for channel, one in found.surprises.items()
    )
    noise = found.position_noise_m
    parts = [f"estimate: within its 95 %: {shares or 'nothing came'}"]
    if noise is not None:
        parts.append(f"fixes taken for good to {noise:.2f} m")
    if found.slips:
        parts.append(f"the receiver slipped {found.slips} times")
    forward, late = found.mounting.antenna_forward_m, found.mounting.fixes_late_s
    if forward.observable:
        parts.append(f"antenna {forward.value:.2f} ± {1.96 * forward.std:.2f} m ahead of the axle")
    if late.observable:
        parts.append(f"fixes {1e3 * late.value:.0f} ± {1.96e3 * late.std:.0f} ms late")
    if found.widened > 1.0:
        parts.append(f"spreads widened by {found.widened:.1f}")
    return "; ".join(parts)
