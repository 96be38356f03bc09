"""What the display says, in words short enough for a glance; pure functions of what is known."""

from __future__ import annotations

from typing import NamedTuple

from foretwin.contracts.gap import Culprit, LimitedQuantity, Verdict, limits_after
from foretwin.contracts.simulation import MirrorSample, Progress
from foretwin.contracts.terminal import plain
from foretwin.contracts.towards_vehicle import Injection
from foretwin.viewer.copilot.round_now import OLD_ROUND_S
from foretwin.viewer.danger import Danger

FAR_S = 99.0
"""From so many seconds on minutes say more."""
INJECTION_FOR_S = 1.0
"""So long a word of the gate is shown: five of it are missing then."""
_CULPRITS: dict[Culprit, str] = {
    "vehicle": "vehicle departs",
    "model": "model is off",
    "both": "vehicle and model off",
}


class TwinStanding(NamedTuple):
    """How the twin stands to the car: in large letters, in small ones, and whether all is well."""

    text: str
    detail: str
    well: bool


def seconds(value: float) -> str:
    """Return a span of time as it is said: whole seconds, tenths below three, minutes when far."""
    if value < 2.95:
        return f"{max(value, 0.0):.1f} s"
    if value < FAR_S:
        return f"{value:.0f} s"
    return f"{value / 60.0:.0f} min"


def arrival(progress: Progress) -> str:
    """Return in how many seconds the car is at the junction ahead, in whole ones."""
    if progress.arrival_in_s is None:
        return "waiting"
    if progress.arrival_in_s >= FAR_S:
        return seconds(progress.arrival_in_s)
    return f"{progress.arrival_in_s:.0f} s"


def arrival_span(progress: Progress) -> str:
    """Return between which seconds eight of ten arrivals lie; empty where that is not known."""
    if progress.arrival_in_s is None or progress.arrival_early_s is None:
        return ""
    if progress.arrival_late_s is None:
        return f"{progress.arrival_early_s:.0f} s or later"
    return f"{progress.arrival_early_s:.0f} to {progress.arrival_late_s:.0f} s"


def danger_text(danger: Danger | None, *, elapsed_s: float = 0.0) -> str:
    """Return the danger with its likelihood and the seconds that are left of it."""
    if danger is None:
        return "no danger found"
    left = seconds(max(0.0, danger.in_s - elapsed_s))
    near = "" if danger.hits else "near miss, "
    return f"{danger.what}, {near}{danger.odds}, {left}"


def standing_of(mirror: MirrorSample | None, verdict: Verdict | None) -> TwinStanding:
    """Return how the twin stands to the car; a verdict says more than a gap.

    Gaps count by the one table of limits, after as long as the twin has run freely.
    """
    if verdict is not None and (said := _CULPRITS.get(verdict.culprit)) is not None:
        return TwinStanding(said, plain(verdict.text), False)
    if mirror is None:
        return TwinStanding("no twin yet", "", True)
    limits = limits_after(mirror.since_reset_s)
    gaps: dict[LimitedQuantity, float] = {
        "along_m": mirror.gap_along_m,
        "across_m": mirror.gap_across_m,
        "yaw_rad": mirror.gap_yaw_rad,
        "speed_mps": mirror.gap_speed_mps,
    }
    worst = max(gaps, key=lambda name: abs(gaps[name]) / limits[name])
    beyond = abs(gaps[worst]) > limits[worst]
    if not mirror.independent:
        # It was driven by the very motion that it is compared with: its gap proves nothing.
        text = "twin apart" if beyond else "twin in step"
        return TwinStanding(text, "commands estimated: no proof", True)
    if not beyond:
        return TwinStanding("twin in step", "", True)
    return TwinStanding(f"twin {_gap_text(worst, gaps[worst])}", "beyond its limit", False)


def _gap_text(name: LimitedQuantity, value: float) -> str:
    size = abs(value)
    match name:
        case "along_m":
            return f"{size:.1f} m {'ahead' if value > 0.0 else 'behind'}"
        case "across_m":
            return f"{size:.1f} m {'left' if value > 0.0 else 'right'}"
        case "yaw_rad":
            return f"{size * 57.29578:.0f}° {'left' if value > 0.0 else 'right'}"
        case "speed_mps":
            return f"{size * 3.6:.0f} km/h {'fast' if value > 0.0 else 'slow'}"


def virtual_objects(told: Injection | None, *, age_s: float) -> str:
    """Return whether the car on its lot is shown what is virtual; empty where none is on a lot."""
    if told is None:
        return ""
    if age_s > INJECTION_FOR_S:
        return "virtual objects: not known"
    room = f"fence {told.fence_m:.0f} m off, {told.margin_m:.0f} m needed"
    if told.gate == "open":
        return f"virtual objects on · {room}"
    return f"virtual objects off: {told.reason} · {room}"


def sentence(
    progress: Progress | None,
    control: str,
    danger: Danger | None,
    standing: TwinStanding,
    *,
    known: bool = True,
    elapsed_s: float = 0.0,
) -> str:
    """Return all that counts now in one sentence: when, where, who waits, what threatens, twin.

    `known` says that there is a current round: without one nobody can say what threatens.
    """
    if progress is None:
        return "waiting for the drive"
    if progress.next_intersection is None:
        where = ["no junction ahead"]
    else:
        where = [arrival(progress), plain(progress.next_intersection), control]
    threat = danger_text(danger, elapsed_s=elapsed_s) if known else "no futures now"
    ago = f" {elapsed_s:.0f} s ago" if elapsed_s > OLD_ROUND_S else ""
    if danger is not None:
        threat = f"greatest danger{ago}: {threat}"
    elif known:
        threat += ago
    return " · ".join(part for part in (*where, threat, standing.text) if part)
