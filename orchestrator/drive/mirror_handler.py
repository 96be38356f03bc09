"""What the mirror says: rows of its tables, and who touches whom as it happens."""

from __future__ import annotations

from collections.abc import Callable

from foretwin.contracts.simulation import MirrorSample
from foretwin.orchestrator.instructions import Tell
from foretwin.orchestrator.record.columns import row_of
from foretwin.orchestrator.record.results import MIRROR, MIRRORED, ResultTables

_APART_NS = 2_000_000_000
"""Who touches again sooner is not told of again."""


class MirrorHandler:
    """Takes the mirror's samples in order."""

    def __init__(self, tables: ResultTables, tell: Callable[[Tell], None]) -> None:
        self.stamp_ns = 0
        """Of the newest sample."""
        self.independent: bool | None = None
        self.touches = 0
        """Times that two began to touch."""
        self._tables = tables
        self._tell = tell
        self._touched_ns: dict[tuple[str, str], int] = {}

    def take(self, sample: MirrorSample) -> None:
        """Keep a sample, and tell of touches that begin."""
        self.stamp_ns = sample.stamp_ns
        self.independent = sample.independent
        at = {"stamp_ns": sample.stamp_ns}
        self._tables.add("mirror", [row_of(sample, MIRROR)])
        if sample.others:
            self._tables.add("mirrored", [at | row_of(other, MIRRORED) for other in sample.others])
        if sample.touches:
            touches = [at | {"one": one, "other": other} for one, other in sample.touches]
            self._tables.add("touches", touches)
        for pair in sample.touches:
            last_ns = self._touched_ns.get(pair)
            self._touched_ns[pair] = sample.stamp_ns
            if last_ns is None or sample.stamp_ns - last_ns > _APART_NS:
                self.touches += 1
                one, other = ("what stands" if name == "world" else name for name in pair)
                self._tell(Tell("warning", f"in the mirror, {one} and {other} touch"))
