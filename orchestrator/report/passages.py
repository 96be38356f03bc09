"""Junction by junction: rounds before the car came, futures that count, what it then did."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc

from foretwin.contracts.frames import GeoPoint, LocalFrame, local_from_geo
from foretwin.contracts.simulation import AMBER_FROM, RED_FROM
from foretwin.orchestrator.record.visited import by_passage
from foretwin.orchestrator.report.blocks import Tone
from foretwin.orchestrator.report.material import RunMaterial, TableRow, most_critical
from foretwin.sim_worker.driver_model import STANDING_MPS

WORST, LIKELIEST = 5, 3
"""So many futures of a junction are told."""
_PICTURE_BEFORE_S = 4.0
"""Where no future is worse than another, the picture is of so long before the car was there."""
_NEAR_M = 60.0


class JunctionPassed(NamedTuple):
    """A junction as a run has it: its entry of run.json, its rounds, those futures that are told.

    `shown_round` is the one that is drawn; None where no round was complete.
    """

    number: int
    place: Mapping[str, Any]
    rounds: tuple[TableRow, ...]
    worst: tuple[TableRow, ...]
    likeliest: tuple[TableRow, ...]
    shown_round: TableRow | None
    futures: int
    collided: int

    @property
    def anchor(self) -> str:
        """What links to it name."""
        return f"junction-{self.number}"

    @property
    def name(self) -> str:
        """What a driver would call it."""
        return str(self.place.get("name") or self.place.get("id") or "junction without a name")

    @property
    def arrived_s(self) -> float | None:
        """Drive time at its centre, None where the car was not there."""
        arrived = self.place.get("arrived_at_s")
        return None if arrived is None else float(arrived)

    @property
    def gravest(self) -> float | None:
        """The highest criticality that was foreseen."""
        known = [one["criticality"] for one in self.worst if one["criticality"] is not None]
        return max(known, default=None)


class WhatCame(NamedTuple):
    """What the car did at a junction: speeds within 60 m before it, None where it is not known."""

    speed_mps: float | None
    slowest_mps: float | None
    stood_s: float
    errors_m: dict[float, float]
    """Mean distance of the nominal future from the drive, by horizon."""
    outcomes: dict[str, int]
    """Windows simulated and driven, by how they were judged."""


def tone_of(criticality: float | None) -> Tone:
    """Return how a criticality is to be taken, by the one table of limits."""
    if criticality is None or criticality < AMBER_FROM:
        return ""
    return "bad" if criticality >= RED_FROM else "watch"


def passages(run: RunMaterial) -> list[JunctionPassed]:
    """Return the junctions of a run in the order in which the car came there; those that it saw
    ahead and did not reach come last."""
    reached = [dict(place) for place in run.record.get("intersections") or []]
    rounds = by_passage(run.rounds, reached)
    known = {row["id"]: row for row in run.rows("junctions")}
    ahead = [
        {**known.get(junction_id, {"id": junction_id}), "arrived_at_s": None}
        for junction_id, which in rounds
        if which is None
    ]
    by_round = _futures_by_round(run.futures)
    found = []
    for number, place in enumerate([*reached, *ahead], start=1):
        which = number - 1 if number <= len(reached) else None
        mine = tuple(rounds.get((place["id"], which), ()))
        found.append(_passage(number, place, mine, by_round, _named_in(run, mine)))
    return found


def _named_in(run: RunMaterial, rounds: Sequence[TableRow]) -> Mapping[str, Any]:
    """Return what the World of a junction says of it, for one that the car did not reach."""
    world = run.world(rounds[-1]["world_id"]) if rounds else None
    if world is None:
        return {}
    place = world.intersection
    return {
        "name": place.name,
        "kind": place.kind,
        "control": place.control,
        "lat": place.lat,
        "lon": place.lon,
    }


def _futures_by_round(futures: pa.Table | None) -> dict[int, pa.Table]:
    if futures is None:
        return {}
    order = futures.sort_by("round_id")
    ids = order["round_id"].to_numpy()
    starts = np.flatnonzero(np.r_[True, np.diff(ids) != 0])
    ends = np.r_[starts[1:], len(ids)]
    return {
        int(ids[start]): order.slice(start, end - start)
        for start, end in zip(starts.tolist(), ends.tolist(), strict=True)
    }


def _passage(
    number: int,
    place: Mapping[str, Any],
    rounds: tuple[TableRow, ...],
    by_round: Mapping[int, pa.Table],
    named: Mapping[str, Any],
) -> JunctionPassed:
    tables = [by_round[row["round_id"]] for row in rounds if row["round_id"] in by_round]
    futures = pa.concat_tables(tables).filter(pc.field("valid")) if tables else None
    worst = worst_of(futures, WORST)
    shown = _shown(rounds, worst, place.get("arrived_at_s"))
    likeliest: tuple[TableRow, ...] = ()
    if shown is not None and shown["round_id"] in by_round:
        mine = by_round[shown["round_id"]].filter(pc.field("valid"))
        likeliest = tuple(
            mine.sort_by([("likelihood", "descending")]).slice(0, LIKELIEST).to_pylist()
        )
    counted = 0 if futures is None else futures.num_rows
    return JunctionPassed(
        number=number,
        place={**named, **{key: value for key, value in place.items() if value is not None}},
        rounds=rounds,
        worst=worst,
        likeliest=likeliest,
        shown_round=shown,
        futures=counted,
        collided=0 if futures is None else pc.sum(futures["collided"]).as_py() or 0,
    )


def worst_of(futures: pa.Table | None, most: int) -> tuple[TableRow, ...]:
    """Return the worst futures, one of each scenario; none without a table."""
    if futures is None:
        return ()
    return most_critical(futures, most, of=lambda row: row["scenario"] or row["name"].split(",")[0])


def _shown(
    rounds: Sequence[TableRow], worst: Sequence[TableRow], arrived_s: float | None
) -> TableRow | None:
    """Return the round of the worst future, or one shortly before the car was there."""
    if not rounds:
        return None
    by_id = {row["round_id"]: row for row in rounds}
    if worst and worst[0]["round_id"] in by_id:
        return by_id[worst[0]["round_id"]]
    wanted_s = rounds[-1]["drive_time_s"] if arrived_s is None else arrived_s - _PICTURE_BEFORE_S
    return min(rounds, key=lambda row: abs(row["drive_time_s"] - wanted_s))


def what_came(run: RunMaterial, passed: JunctionPassed) -> WhatCame:
    """Return what the car did there, and how far what was foreseen lay from it."""
    ids = {row["round_id"] for row in passed.rounds}
    errors: dict[float, list[float]] = defaultdict(list)
    for row in run.rows("comparisons"):
        if row["round_id"] in ids:
            errors[row["horizon_s"]].append(row["nominal_ade_m"])
    outcomes: dict[str, int] = defaultdict(int)
    for row in run.rows("agreement"):
        if row["round_id"] in ids:
            outcomes[row["outcome"]] += 1
    speed, slowest, stood_s = _speeds(run, passed)
    means = {horizon: float(np.mean(values)) for horizon, values in sorted(errors.items())}
    return WhatCame(speed, slowest, stood_s, means, dict(outcomes))


def _speeds(run: RunMaterial, passed: JunctionPassed) -> tuple[float | None, float | None, float]:
    track, at_s = run.track, passed.arrived_s
    if track is None or at_s is None or "lat" not in passed.place:
        return None, None, 0.0
    centre = LocalFrame(GeoPoint(passed.place["lat"], passed.place["lon"]))
    before = track.between(-np.inf, at_s)
    if not len(before.time_s):
        return None, None, 0.0
    away_m = np.hypot(*local_from_geo(centre, *before.lat_lon_deg.T).T)
    outside = np.flatnonzero(away_m > _NEAR_M)
    near = before.between(before.time_s[outside[-1]] if len(outside) else -np.inf, at_s)
    steps_s = np.diff(near.time_s, append=near.time_s[-1])
    stood_s = float(steps_s[np.abs(near.speed_mps) < STANDING_MPS].sum())
    return float(before.speed_mps[-1]), float(near.speed_mps.min()), stood_s
