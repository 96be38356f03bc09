"""The first page of a drive's report: what it comes to in a few sentences, and five numbers."""

from __future__ import annotations

from collections.abc import Sequence

from foretwin.contracts.simulation import AMBER_FROM, RED_FROM
from foretwin.orchestrator.report.blocks import (
    UNKNOWN,
    KeyFigure,
    Tone,
    plural,
    power,
)
from foretwin.orchestrator.report.junction_parts import scenario_of
from foretwin.orchestrator.report.material import RunMaterial, in_lock_step, part_of
from foretwin.orchestrator.report.passages import JunctionPassed, tone_of

_LATE_SHARE = 0.1
"""Of the rounds that could begin, when more are not in time the first page says so in amber."""


def verdict_of(run: RunMaterial, passed: Sequence[JunctionPassed]) -> tuple[str, Tone]:
    """Return what the drive comes to in short sentences, and how it is to be taken."""
    record = run.record
    if not record:
        return "The folder holds no record of a drive: nothing can be said of it.", "bad"
    reached = [one for one in passed if one.arrived_s is not None]
    said: list[str] = []
    tone: Tone = "good"
    if not passed:
        said.append("the car met no junction")
        tone = "watch"
    else:
        said.append(f"the car passed {plural(len(reached), 'junction')}")
    worst = max(
        (one for one in passed if one.gravest), key=lambda one: one.gravest or 0.0, default=None
    )
    if worst is not None:
        grave = worst.gravest or 0.0
        said.append(
            f"the gravest of what was foreseen is {_level(grave)}: "
            f"{scenario_of(worst.worst[0])} at {worst.name}"
        )
        tone = _graver(tone, tone_of(grave))
    elif passed and not run.futures_unread:
        said.append("nothing critical was foreseen")
    said, tone = _about_reality(run, said, tone)
    late = rounds_in_time(run)
    if late is not None and late[0] < (1.0 - _LATE_SHARE) * late[1]:
        said.append(f"only {late[0]} of {late[1]} rounds were there in time")
        tone = _graver(tone, "watch")
    if troubles := [*(record.get("troubles") or []), *(part_of(record, "recovered", "lost") or [])]:
        said.append(f"something is missing: {str(troubles[0]).rstrip('.')}")
        tone = "bad"
    if run.unread:
        said += run.unread
        tone = "bad"
    return " ".join(f"{one[0].upper()}{one[1:]}." for one in said), tone


def _level(criticality: float) -> str:
    if criticality >= RED_FROM:
        return "grave"
    return "to be watched" if criticality >= AMBER_FROM else "not critical"


def _about_reality(run: RunMaterial, said: list[str], tone: Tone) -> tuple[list[str], Tone]:
    overall = part_of(run.record, "agreement", "overall")
    if overall:
        agree = overall["agree_pass"] + overall["agree_fail"]
        wrong = overall["too_pessimistic"] + overall["too_optimistic"]
        if agree + wrong:
            judged = plural(agree + wrong, "judged window")
            said.append(f"simulation and reality agree in {agree} of {judged}")
            tone = _graver(tone, "watch" if wrong else "")
    verdicts = part_of(run.record, "tuning", "verdicts") or []
    if verdicts:
        said.append(f"{verdicts[-1]['culprit']} departs ({verdicts[-1]['text']})")
        tone = "bad"
    return said, tone


def _graver(one: Tone, other: Tone) -> Tone:
    order: tuple[Tone, ...] = ("", "good", "watch", "bad")
    return max(one, other, key=order.index)


def rounds_in_time(run: RunMaterial) -> tuple[int, int] | None:
    """Return how many rounds were complete in time, of how many that were due and could begin.

    None where that is not known, and in lock step, where a drive waits for its rounds.
    """
    if in_lock_step(run.record):
        return None
    told = part_of(run.record, "ledger", "rounds")
    if not told or any(told.get(name) is None for name in ("due", "run", "unseeded")):
        return None
    late = part_of(run.record, "futures", "late_rounds") or 0
    return told["run"] - late, told["due"] - told["unseeded"]


def figures_of(run: RunMaterial, passed: Sequence[JunctionPassed]) -> tuple[KeyFigure, ...]:
    """Return the five numbers of the first page."""
    rounds, futures = plural(len(run.rounds), "round"), sum(one.futures for one in passed)
    reached = sum(one.arrived_s is not None for one in passed)
    gravest = max((one.gravest or 0.0 for one in passed), default=0.0)
    error = part_of(run.record, "comparison", "ade_m", "4")
    base = part_of(run.record, "comparison", "constant_velocity_ade_m", "4")
    agree = part_of(run.record, "agreement", "overall")
    return (
        KeyFigure(
            str(reached),
            "junctions passed",
            rounds if run.futures_unread else f"{plural(futures, 'future')} in {rounds}",
        ),
        KeyFigure(
            UNKNOWN if run.futures_unread else "none" if not gravest else power(gravest, 0),
            "gravest foreseen",
            f"criticality; amber from {power(AMBER_FROM, 0)}, red from {power(RED_FROM, 0)}",
            tone_of(gravest),
        ),
        KeyFigure(
            UNKNOWN if error is None else f"{error:.1f} m",
            "off after 4 s",
            "mean of the nominal future"
            + ("" if base is None else f"; constant speed: {base:.1f} m"),
        ),
        _agreement_figure(agree),
        _pace_figure(run),
    )


def _agreement_figure(overall: dict[str, int] | None) -> KeyFigure:
    name = "simulation agrees"
    if not overall:
        return KeyFigure(UNKNOWN, name, "no seconds were simulated and driven")
    agree = overall["agree_pass"] + overall["agree_fail"]
    judged = agree + overall["too_pessimistic"] + overall["too_optimistic"]
    if not judged:
        return KeyFigure(UNKNOWN, name, f"{overall['not_observable']} windows, none can be judged")
    note = f"{agree} of {judged} judged windows; {overall['not_observable']} cannot be"
    return KeyFigure(f"{agree / judged:.0%}", name, note, "good" if agree == judged else "watch")


def _pace_figure(run: RunMaterial) -> KeyFigure:
    name = "rounds in time"
    if in_lock_step(run.record):
        return KeyFigure(UNKNOWN, name, "in lock step the drive waits for its rounds")
    found = rounds_in_time(run)
    if found is None or not found[1]:
        return KeyFigure(UNKNOWN, name, "no round was due, or it is not known")
    in_time, asked = found
    tone: Tone = "watch" if in_time < (1.0 - _LATE_SHARE) * asked else "good"
    p95 = run.record.get("state_to_result_ms_p95")
    took = "" if p95 is None else f"; 95 % within {p95:.0f} ms"
    note = f"{in_time} of {asked} that could begin{took}"
    return KeyFigure(f"{in_time / asked:.0%}", name, note, tone)
