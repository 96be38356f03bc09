"""What the mirror says: rows of its tables, and who touches whom as it happens."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field

from foretwin.contracts.gap import limits_after
from foretwin.contracts.roles import WHAT_STANDS
from foretwin.contracts.simulation import MirrorSample
from foretwin.orchestrator.instructions import Notice
from foretwin.orchestrator.record.results import MIRROR, MIRRORED, ResultTables
from foretwin.sim_worker.futures.columns import row_of

_APART_NS = 2_000_000_000
"""Who touches again sooner is not told of again."""
_KNOWN = 600
"""Stamps of the last minute."""


@dataclass(slots=True)
class MirrorHandler:
    """Takes the mirror's samples in order."""

    tables: ResultTables
    tell: Callable[[Notice], None]
    vehicle_id: str
    """Of the drive's own car."""
    stamp_ns: int = 0
    """Of the newest sample."""
    independent: bool | None = None
    """Whether the free twin has run by recorded commands yet: some may be late or lost."""
    compared: int = 0
    """Samples of a free twin under recorded commands, and those beyond a limit of the alarms."""
    beyond: int = 0
    touches: int = 0
    """Times that two began to touch."""
    _gap_m: float = 0.0
    """Between car and twin in the sample before: one that touches is set back to the car."""
    _touched_ns: dict[tuple[str, str], int] = field(default_factory=dict)
    _stamps_ns: deque[int] = field(default_factory=lambda: deque(maxlen=_KNOWN))

    def take(self, sample: MirrorSample) -> None:
        """Keep a sample, and tell of touches that begin.

        A mirror that was started again begins with a state that the one before it has answered.
        """
        if sample.stamp_ns in self._stamps_ns:
            return
        self._stamps_ns.append(sample.stamp_ns)
        self.stamp_ns = sample.stamp_ns
        self.independent = sample.independent or bool(self.independent)
        if sample.independent:
            self.compared += 1
            self.beyond += _is_beyond(sample)
        at = {"stamp_ns": sample.stamp_ns}
        self.tables.add("mirror", [row_of(sample, MIRROR)])
        if sample.others:
            self.tables.add("mirrored", [at | row_of(other, MIRRORED) for other in sample.others])
        if sample.touches:
            touches = [at | {"one": one, "other": other} for one, other in sample.touches]
            self.tables.add("touches", touches)
        lately = sample.stamp_ns - _APART_NS
        self._touched_ns = {pair: ns for pair, ns in self._touched_ns.items() if ns >= lately}
        for pair in sample.touches:
            apart = pair not in self._touched_ns
            self._touched_ns[pair] = sample.stamp_ns
            if apart:
                self.touches += 1
                self.tell(Notice("warning", f"in the mirror, {self._in_words(*pair)}"))
        self._gap_m = sample.gap_m

    def _in_words(self, one: str, other: str) -> str:
        if WHAT_STANDS not in (one, other):
            return f"{one} and {other} touch"
        # Shadows go through what stands: only what physics moves can touch it.
        name = other if one == WHAT_STANDS else one
        apart = f", {self._gap_m:.1f} m off the car" if name == self.vehicle_id else ""
        return f"the twin of {name} touches what stands{apart}"

    def record(self) -> dict[str, int]:
        """Return the `free_twin` of run.json."""
        return {"samples": self.compared, "beyond_limits": self.beyond}


def _is_beyond(sample: MirrorSample) -> bool:
    limits = limits_after(sample.since_reset_s)
    return any(abs(getattr(sample, f"gap_{name}")) > limit for name, limit in limits.items())
