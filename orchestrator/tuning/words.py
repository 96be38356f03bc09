"""Findings in the engineer's words: one line each."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

from foretwin.contracts.gap import GapAlarm, Verdict
from foretwin.contracts.tuning import ParameterEstimate
from foretwin.orchestrator.record.whereabouts import instant

_QUANTITIES = {
    "along_m": ("position along", "m", 1.0),
    "across_m": ("position across", "m", 1.0),
    "yaw_rad": ("heading", "°", math.degrees(1.0)),
    "speed_mps": ("speed", "m/s", 1.0),
}
_HOW = {"identified": "identified", "set": "set by hand", "rolled_back": "rolled back"}
_EACH_ITS_LINE = 3
_ONE = {"vehicle": "the vehicle", "model": "the model"}
_CULPRITS = _ONE | {"both": "vehicle and model", "none": "neither", "undecided": "undecided"}


def alarm_text(alarm: GapAlarm) -> str:
    """Return what a GapAlarm says."""
    name, unit, scale = _QUANTITIES.get(alarm.quantity, (alarm.quantity, "", 1.0))
    limit = f"limit {scale * alarm.limit:.2g} {unit}"
    if alarm.over:
        return f"gap: {name} off by {scale * alarm.value:+z.2f} {unit} ({alarm.manoeuvre}, {limit})"
    return f"gap: {name} within its limit again ({scale * alarm.value:+z.2f} {unit}, {limit})"


def verdict_text(verdict: Verdict) -> str:
    """Return what a Verdict says."""
    who = _CULPRITS[verdict.culprit]
    return f"verdict: {who}, {verdict.cause} ({verdict.confidence:.2f}): {verdict.text}"


def found_text(found: ParameterEstimate, counts: float) -> str:
    """Return an estimate that departs from the value that counts."""
    return (
        f"{found.name}: the driving says {found.value:.5g} ({found.low:.5g} to {found.high:.5g}), "
        f"in use is {counts:.5g}"
    )


def _why_none(gap: dict[str, Any]) -> str:
    if not gap["independent"]:
        return "whether vehicle or model departs cannot be said: no commands were recorded"
    if gap["alarms"]:
        return "the gap was beyond its limits, and nothing shows whether by vehicle or model"
    return "nothing shows that vehicle or model departs beyond what parameters leave open"


def summary_lines(
    tuning: dict[str, Any], intersections: Sequence[dict[str, Any]] = ()
) -> list[str]:
    """Return what the end of a drive says of gap, verdicts and parameters, from its record.

    `intersections` are those of the record.
    """
    lines = []
    gap, rms = tuning["gap"], tuning["gap"]["rms"]["all"]
    if rms is not None:
        told = "no limits hold, since commands were estimated from the motion"
        if gap["independent"]:
            told = f"{gap['alarms']} alarm{'s' if gap['alarms'] != 1 else ''}"
            told += f", beyond a limit {gap['beyond_limits']} of {gap['samples']} times"
            if gap["without_commands"]:
                count = gap["without_commands"]
                told += f" (commands were missing {count} time{'s' if count != 1 else ''} more)"
        lines.append(
            f"  left to itself for {gap['horizon_s']:g} s, the model is off by "
            f"{rms['along_m']:.2f} m along the road, {rms['across_m']:.2f} m across, "
            f"{math.degrees(rms['yaw_rad']):.1f}° and {rms['speed_mps']:.2f} m/s (RMS); {told}"
        )
    lines += [
        f"  verdict {instant(verdict['drive_time_s'], intersections)}: "
        f"{_CULPRITS[verdict['culprit']]}, {verdict['cause']}: {verdict['text']}"
        for verdict in tuning["verdicts"]
    ]
    if rms is not None and not tuning["verdicts"]:
        lines.append(f"  {_why_none(gap)}")
    first: dict[str, float] = {}
    last = {change["name"]: change for change in tuning["changes"]}
    for change in tuning["changes"]:
        first.setdefault(change["name"], change["before"])
    lines += [
        f"  {name} is now {change['value']:.5g}, was {first[name]:.5g} ({_HOW[change['origin']]})"
        for name, change in last.items()
    ]
    departs = [one for one in tuning["parameters"] if one["departs"]]
    finer = [one for one in departs if one["left_open"]]
    if finer:
        told = ", ".join(f"{one['name']} {one['identified']:.4g}" for one in finer)
        lines.append(f"  found, within what the vehicle file leaves open: {told}")
    apart = [one for one in departs if not one["left_open"]]
    if len(apart) > _EACH_ITS_LINE:
        told = ", ".join(f"{one['name']} {one['identified']:.4g}" for one in apart)
        return [*lines, f"  the driving says other than the vehicle in use: {told}"]
    return lines + [
        f"  {one['name']}: the driving says {one['identified']:.5g} ({one['low']:.5g} to "
        f"{one['high']:.5g}), in use is {one['in_use']:.5g}"
        for one in apart
    ]
