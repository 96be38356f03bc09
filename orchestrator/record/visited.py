"""The junctions that a car reached, from the tables of its run."""

from __future__ import annotations

from collections import defaultdict
from pathlib import Path
from typing import Any, NamedTuple

from foretwin.orchestrator.record.kept_rows import kept_rows


class RoundsOf(NamedTuple):
    """So many rounds of a junction, of so many futures."""

    rounds: int = 0
    futures: int = 0


class Visited(NamedTuple):
    """The `intersections` of run.json, and the rounds of junctions that were not reached yet."""

    records: list[dict[str, Any]]
    ahead: dict[str, RoundsOf]


def visited_junctions(results: Path) -> Visited:
    """Return what the tables of junctions and rounds tell, in the order of the passages.

    A passage counts as its last row says. A round belongs to the passage that was seen ahead last.
    """
    passages: dict[tuple[str, float], dict[str, Any]] = {}
    for row in kept_rows(results, "junctions"):
        passages[row["id"], row["seen_at_s"]] = row
    seen_at_s: dict[str, list[float]] = defaultdict(list)
    for junction_id, seen_s in passages:
        seen_at_s[junction_id].append(seen_s)
    count: dict[tuple[str, float | None], RoundsOf] = defaultdict(RoundsOf)
    for row in kept_rows(results, "rounds", "intersection_id", "drive_time_s", "futures"):
        junction_id = row["intersection_id"]
        known = seen_at_s.get(junction_id, [])
        before = [seen_s for seen_s in known if seen_s <= row["drive_time_s"]] or known[:1]
        which = (junction_id, before[-1] if before else None)
        count[which] = RoundsOf(count[which].rounds + 1, count[which].futures + row["futures"])
    records = []
    for key, row in passages.items():
        told = {name: value for name, value in row.items() if name != "seen_at_s"}
        records.append({**told, **count[key]._asdict()})
    ahead = {junction_id: of for (junction_id, seen_s), of in count.items() if seen_s is None}
    return Visited(records, ahead)
