"""Which of the vehicle's samples are missing in a recording, and which death took them along."""

from __future__ import annotations

import json
import time
from collections.abc import Iterator
from typing import Any, NamedTuple

from foretwin.contracts.segments import segments_of
from foretwin.telemetry.standin.sensors import PERIOD_MS
from foretwin.telemetry.standin.source import START_STAMP_NS
from tests.chaos.faults import DEADLY
from tests.chaos.left import Left
from tests.chaos.parts import END_S
from tests.telemetry.own_recordings import read_drive

MOST_LOST_S = 1.0
"""Of the telemetry, to one death."""
TAKES_ALONG = ("recorder", "vehicle", "router", "orchestrator", "supervisor", "car")
"""Who may take samples along."""
RATE_HZ = sum(1000 / period_ms for period_ms in PERIOD_MS.values())
_AFTER_S, _BEFORE_S = 3.0, 10.0
"""How far from a gap a death may lie that it is put down to: what a car had to say that stood still
for 10 s comes at once, with its old stamps."""
_UNTOLD_NS = 200_000_000
"""Of a drive that did not come to its end, the last samples may have been said to nobody."""


class Gap(NamedTuple):
    """Samples of one channel that follow each other and are missing."""

    channel: str
    first_ns: int
    last_ns: int
    lost_s: float


def gaps(left: Left, *, completed: bool) -> list[Gap]:
    """Return what is missing of the stand-in car's regular samples."""
    held: dict[str, set[int]] = {name: set() for name in PERIOD_MS}
    for part in segments_of(left.run / "drive.mcap"):
        for channel, message in read_drive(part):
            if channel in held:
                held[channel].add(message.stamp_ns)  # type: ignore[attr-defined]
    whole_ns = START_STAMP_NS + round(END_S * 1e9)
    newest_ns = max(
        (stamp for stamps in held.values() for stamp in stamps if stamp <= whole_ns), default=0
    )
    until_ns = whole_ns - 1 if completed else newest_ns - _UNTOLD_NS
    return [gap for name in PERIOD_MS for gap in _gaps_of(name, held[name], until_ns)]


def _gaps_of(channel: str, held: set[int], until_ns: int) -> Iterator[Gap]:
    period_ns = PERIOD_MS[channel] * 1_000_000
    first_ns: int | None = None
    for stamp_ns in range(START_STAMP_NS, until_ns + period_ns, period_ns):
        missing = stamp_ns not in held and stamp_ns <= until_ns
        if missing and first_ns is None:
            first_ns = stamp_ns
        if not missing and first_ns is not None:
            yield Gap(channel, first_ns, stamp_ns - period_ns, (stamp_ns - first_ns) * 1e-9)
            first_ns = None


def losses_by_death(left: Left, found: list[Gap]) -> tuple[dict[int, float], list[Gap]]:
    """Return the seconds that each death took along, by the number of its fault, and the rest."""
    begun_ns = _begun_ns(left)
    deaths = [
        (number, one.at_ns - begun_ns + START_STAMP_NS)
        for number, one in enumerate(left.done)
        if one.kind in TAKES_ALONG and one.fault.what in DEADLY
    ]
    lost_s: dict[int, dict[str, float]] = {number: {} for number, _ in deaths}
    rest = []
    for gap in found:
        near = [
            (max(gap.first_ns - at_ns, at_ns - gap.last_ns, 0), number)
            for number, at_ns in deaths
            if gap.first_ns < at_ns + _AFTER_S * 1e9 and gap.last_ns > at_ns - _BEFORE_S * 1e9
        ]
        if not near:
            rest.append(gap)
            continue
        channels = lost_s[min(near)[1]]
        channels[gap.channel] = channels.get(gap.channel, 0.0) + gap.lost_s
    return {number: max(by.values(), default=0.0) for number, by in lost_s.items()}, rest


def _begun_ns(left: Left) -> int:
    """Return when the car began to drive, by the monotonic clock."""
    for line in (left.run / "log.jsonl").read_text(encoding="utf-8").splitlines():
        if "the orchestrator is ready" in line:
            # Before any fault: the host's clock had not been set yet.
            wall_s: float = json.loads(line)["wall_s"]
            return time.monotonic_ns() - round((time.time() - wall_s) * 1e9)
    raise ValueError("the log does not say when the car began")


def wrong_losses(left: Left, record: dict[str, Any]) -> Iterator[str]:
    """Say which samples are missing that no death explains, and which death took too many."""
    ledger = record.get("ledger", {}).get("telemetry", {"lost": 0})
    completed = record["exit"] == "completed"
    if left.case.source == "live":
        yield from _wrong_live(left, ledger)
        return
    by_death, rest = losses_by_death(left, gaps(left, completed=completed))
    left.lost_s.update(by_death)
    for number, lost_s in by_death.items():
        if lost_s > MOST_LOST_S:
            yield f"{lost_s:.2f} s of telemetry are lost to one death: {left.done[number]}"
    # What a disk did not take is no death's; it must have been told.
    if rest and not (left.befell("disk", what=("full", "read_only")) and ledger["lost"]):
        yield f"{len(rest)} gaps are no death's: {rest[:3]}"


def _wrong_live(left: Left, ledger: dict[str, Any]) -> Iterator[str]:
    """A live car's stamps jump: what is missing is known by its numbers alone."""
    deaths = [one for one in left.done if one.kind in TAKES_ALONG and one.fault.what in DEADLY]
    others = left.befell(what=("burst", "messages", "full", "read_only"))
    if not others and ledger["lost"] > MOST_LOST_S * RATE_HZ * len(deaths):
        yield f"{ledger['lost']} samples are lost, of {len(deaths)} deaths"
    if deaths and not others:
        for number, one in enumerate(left.done):
            if one in deaths:
                left.lost_s[number] = ledger["lost"] / RATE_HZ / len(deaths)
