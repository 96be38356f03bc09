"""The reality gap as text of 80 columns: tables, verdicts with their evidence."""

from __future__ import annotations

import textwrap
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, Literal

import numpy as np

from foretwin.contracts.arrays import Array
from foretwin.contracts.gap import GapAlarm, Verdict
from foretwin.sim_worker.analysis.gap.clock_offsets import ClockOffset
from foretwin.sim_worker.analysis.gap.errors import GapRow
from foretwin.sim_worker.analysis.gap.measured_turning import NotHeld, TurningGap

WIDTH = 80
_DEGREES = 57.29578
_COLUMNS = (
    ("position_m", "place", "m", 1.0),
    ("along_m", "along", "m", 1.0),
    ("across_m", "across", "m", 1.0),
    ("yaw_rad", "head.", "°", _DEGREES),
    ("yaw_rate_radps", "rate", "°/s", _DEGREES),
    ("speed_mps", "speed", "m/s", 1.0),
    ("accel_mps2", "accel", "m/s²", 1.0),
)


def table_lines(rows: Sequence[GapRow]) -> Iterator[str]:
    """Yield tables of RMS, 95th percentiles and states' doubt, by horizon and manoeuvre."""
    first = f"{'after':>5} {'manoeuvre':<12} {'runs':>5}"
    for title, named in (
        ("RMS of the gap, the model left to itself", "rms"),
        ("95 % of its gaps are below", "p95"),
        ("of which uncertain states leave open (standard deviations, RMS)", "state_std"),
    ):
        yield title
        yield first + "".join(f"{label:>8}" for _, label, _, _ in _COLUMNS)
        yield " " * len(first) + "".join(f"{unit:>8}" for _, _, unit, _ in _COLUMNS)
        for row in rows:
            values: dict[str, float] = getattr(row, named)
            cells = "".join(
                f"{scale * values[name]:>8.2f}" if name in values else f"{'-':>8}"
                for name, _, _, scale in _COLUMNS
            )
            yield f"{row.horizon_s:>3g} s {row.manoeuvre:<12} {row.runs:>5}{cells}"
        yield ""


DrivenBy = Literal["commands", "measured steering and speed", "estimated commands"]
"""What the model was driven by."""


def why_undecided(
    verdicts: Sequence[Verdict], undecided: str, *, driven_by: DrivenBy
) -> str | None:
    """Return why nobody is accused, None where somebody is; `undecided` is what departs."""
    if verdicts:
        return None
    if undecided:
        return undecided
    if driven_by == "commands":
        return "nothing shows that car or model departs beyond what parameters leave open"
    if driven_by == "estimated commands":
        return (
            "commands were not recorded: the gap is that of commands estimated from the motion "
            "itself, and who departs from them cannot be said"
        )
    return (
        "commands were not recorded: the model was driven by steering and speed as measured, and "
        "nothing shows that it departs from the gyro beyond what parameters leave open"
    )


def turning_object(turning: TurningGap) -> dict[str, Any]:
    """Return the turning at the measured steering as JSON has it; intervals are half widths."""
    clocks = {
        "steering": turning.steering_clock,
        "speed": turning.speed_clock,
        "position": turning.position_clock,
    }
    half = turning.half_width_radps
    return {
        "seconds": len(half),
        "within_share": turning.within,
        "interval_full_width_radps": {
            "median": turning.full_width_radps,
            "mean": 2.0 * float(np.mean(half)),
            "widest": 2.0 * float(np.max(half)),
        },
        "error_rms_radps": _rms(turning.error_radps),
        "error_rms_by_file_radps": _rms(turning.file_error_radps),
        "clock_late_s": {
            name: None if clock is None else {"value": clock.late_s, "half_95": _SURE * clock.std_s}
            for name, clock in clocks.items()
        },
        "response_left_open_s": _SURE * turning.response_std_s,
        "gyro_bias_radps": _fitted(turning.gyro_bias_radps, turning.gyro_bias_half_radps),
        "steering_offset_rad": _fitted(
            turning.steering_offset_rad, turning.steering_offset_half_rad
        ),
        "gain": _fitted(turning.gain, turning.gain_half),
        "conditional_on": _CONDITION,
    }


_SURE = 1.96
_CONDITION = (
    "the vehicle file's wheelbase, tyres and inertia, its steering ratio give or take what it "
    "says, and bends and speeds as in this drive"
)


def not_held_lines(turning: NotHeld) -> list[str]:
    """Return why the model was not driven by what was measured."""
    return _wrapped(f"the model was not driven by what was measured: {turning.why}", indent="  ")


def moved_lines(moved_s: Mapping[str, float]) -> list[str]:
    """Return which samples are judged as of another time than they are stamped."""
    if not moved_s:
        return []
    each = ", ".join(f"{name} by {1e3 * late_s:+z.0f} ms" for name, late_s in moved_s.items())
    return [*_wrapped(f"stamped late, and judged without that: {each}", indent="  "), ""]


def turning_lines(turning: TurningGap) -> list[str]:
    """Return what the model at the measured steering says, each second from the others."""
    half = _DEGREES * turning.half_width_radps
    rms = [_DEGREES * _rms(one) for one in (turning.error_radps, turning.file_error_radps)]
    late = (
        f"steering is stamped {_clock(turning.steering_clock)} after the gyro, given the model's "
        f"tyres and inertia, of which the file leaves {1e3 * _SURE * turning.response_std_s:.0f} "
        "ms open"
    )
    if turning.speed_clock is not None:
        late += f"; speed {_clock(turning.speed_clock)}"
    if turning.position_clock is not None:
        late += f"; positions {_clock(turning.position_clock)}"
    bias, bias_half = turning.gyro_bias_radps, turning.gyro_bias_half_radps
    zero, zero_half = turning.steering_offset_rad, turning.steering_offset_half_rad
    said = (
        f"the model at measured steering and speed against the gyro, {len(half)} s: {rms[0]:.2f} "
        f"°/s apart (RMS of means over a second; {rms[1]:.2f} with the vehicle file's steering "
        f"as it is); each second's 95 % interval, told by the others, is ±{np.median(half):.2f} "
        f"°/s wide (median; ±{np.max(half):.2f} at most) and holds {turning.within:.0%} of them",
        late,
        f"gyro bias {_DEGREES * bias:+z.2f} ± {_DEGREES * bias_half:.2f} °/s, steering "
        f"{_DEGREES * zero:+z.2f} ± {_DEGREES * zero_half:.2f}° at the tyres beside the "
        f"file; the car turns {turning.gain:.2f} ± {turning.gain_half:.2f} times as the "
        "model",
        f"intervals (95 %) hold given {_CONDITION}",
    )
    return [line for one in said for line in _wrapped(one, indent="  ")] + [""]


def _clock(clock: ClockOffset) -> str:
    return f"{1e3 * clock.late_s:+z.0f} ± {1e3 * _SURE * clock.std_s:.0f} ms"


def _rms(values: Array) -> float:
    return float(np.sqrt(np.mean(values**2)))


def _fitted(value: float, half: float) -> dict[str, float]:
    return {"value": value, "half_95": half}


def verdict_lines(
    verdicts: Sequence[Verdict],
    alarms: Sequence[GapAlarm],
    reason: str | None,
    *,
    start_ns: int,
) -> Iterator[str]:
    """Yield what is said of alarms and verdicts, with times since the drive's start.

    `reason` says why there is no verdict.
    """
    raised = [alarm for alarm in alarms if alarm.over]
    kinds = ", ".join(dict.fromkeys(alarm.quantity for alarm in raised))
    yield f"alarms: {len(raised)}{f' ({kinds})' if kinds else ''}"
    if reason is not None:
        yield from _wrapped(f"nobody is accused: {reason}")
    for verdict in verdicts:
        who = {"vehicle": "real vehicle", "model": "vehicle model"}.get(
            verdict.culprit, verdict.culprit
        )
        at_s, since_s = (
            (ns - start_ns) * 1e-9 for ns in (verdict.stamp_ns, verdict.since_stamp_ns)
        )
        when = f"verdict at {at_s:.1f} s, since {since_s:.1f} s"
        yield f"{when}: {who}, {verdict.cause} (sure {verdict.confidence:.0%})"
        yield from _wrapped(verdict.text, indent="  ")
        for one in verdict.evidence:
            text = f"{one.name} {one.value:.4g} ± {one.std:.2g}, expected {one.expected:.4g}"
            yield from _wrapped(f"{text}: {one.text}", indent="  - ")


def _wrapped(text: str, *, indent: str = "") -> list[str]:
    then = " " * len(indent)
    wrapper = textwrap.TextWrapper(WIDTH, indent, then, break_long_words=False)
    return wrapper.wrap(text)
