"""The junctions that a car reached, from the tables of its run, and which rounds were whose."""

from __future__ import annotations

import itertools
import math
from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from foretwin.orchestrator.record.kept_rows import kept_rows


class RoundsOf(NamedTuple):
    """So many rounds of a junction, of so many futures."""

    rounds: int = 0
    futures: int = 0

    def plus(self, other: RoundsOf) -> RoundsOf:
        """Return both together."""
        return RoundsOf(self.rounds + other.rounds, self.futures + other.futures)


class Visited(NamedTuple):
    """The `intersections` of run.json, and the rounds of junctions that were not reached yet."""

    records: list[dict[str, Any]]
    ahead: dict[str, RoundsOf]


def visited_junctions(results: Path) -> Visited:
    """Return what the tables of junctions and rounds tell, in the order of the passages.

    A passage counts as its last row says.
    """
    passages: dict[tuple[str, float], dict[str, Any]] = {}
    for row in kept_rows(results, "junctions"):
        passages[row["id"], row["seen_at_s"]] = row
    reached = list(passages.values())
    rounds = kept_rows(results, "rounds", "intersection_id", "drive_time_s", "futures")
    count = {
        key: RoundsOf(len(rows), sum(row["futures"] for row in rows))
        for key, rows in by_passage(rounds, reached).items()
    }
    records = []
    for place, row in enumerate(reached):
        told = {name: value for name, value in row.items() if name != "seen_at_s"}
        records.append({**told, **count.get((row["id"], place), RoundsOf())._asdict()})
    ahead = {junction_id: of for (junction_id, which), of in count.items() if which is None}
    return Visited(records, ahead)


def by_passage(
    rounds: Iterable[dict[str, Any]], reached: Sequence[Mapping[str, Any]]
) -> dict[tuple[str, int | None], list[dict[str, Any]]]:
    """Return rounds by junction and by the place of its passage in `reached`, None where the car
    was never there.

    A round is of the passage that comes next; rounds that go on while the car is about to leave a
    junction, until there are some of another, are of the passage that they began for. `VisitBook`
    counts so while the drive goes on.
    """
    arrivals: dict[str, list[tuple[float, int]]] = defaultdict(list)
    for place, one in enumerate(reached):
        arrivals[one["id"]].append((one.get("arrived_at_s") or 0.0, place))
    found: dict[tuple[str, int | None], list[dict[str, Any]]] = defaultdict(list)
    on_end = itertools.groupby(rounds, key=lambda row: row["intersection_id"])
    blocks = [(junction_id, list(rows)) for junction_id, rows in on_end]
    ends_s = [block[0]["drive_time_s"] for _, block in blocks[1:]] + [math.inf]
    for (junction_id, block), end_s in zip(blocks, ends_s, strict=False):
        told, first_s = arrivals[junction_id], block[0]["drive_time_s"]
        during = [one for one in told if first_s <= one[0] < end_s]
        meant = during or [one for one in told if one[0] >= end_s][:1] or told[-1:]
        for row in block:
            after = [place for at_s, place in meant if at_s >= row["drive_time_s"]]
            which = after[0] if after else meant[-1][1] if meant else None
            found[junction_id, which].append(row)
    return found
