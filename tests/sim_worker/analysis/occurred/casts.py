"""Five hundred staged drives: what is driven, who meets the car in each, what is detected."""

from __future__ import annotations

import functools
from typing import NamedTuple

import numpy as np

from foretwin.contracts.arrays import Array
from foretwin.sim_worker.analysis.occurred.scene import Detected
from foretwin.telemetry.standin.source import START_STAMP_NS
from tests.sim_worker.analysis.occurred.actors import (
    CAR_M,
    Actor,
    beside,
    crosser,
    follower,
    lead,
    neighbour,
    on_foot,
    on_line,
    standing,
    walker,
)
from tests.sim_worker.analysis.occurred.staging import (
    Drive,
    EgoPlan,
    Label,
    Random,
    drive,
    lanes_beside,
    own_labels,
    record_span,
    way_line,
)

DRIVES, PLANS = 500, 20
HELD_OUT = 26
"""Seed of the series that nothing was developed on."""
_SKEW_DEG = {18: 0.0, HELD_OUT: 15.0}
"""Of the crossing of each series of drives, by its seed."""
POSITION_STD_M, MISSED_SHARE, SEEN_WITHIN_M = 0.3, 0.1, 80.0
BURST_CHANCE, BURST_S = 0.3, (0.6, 1.6)
GHOSTS, GHOST_S, GHOST_STD_M = 2.0, (0.2, 1.0), 0.8
CLUTTER_CHANCE, CLUTTER_S = 0.3, (3.0, 6.0)
_OLDER_NS = 10


class Staged(NamedTuple):
    """One staged drive: the car's, who was there, what is staged, and from when it is recorded."""

    drive: Drive
    actors: tuple[Actor, ...]
    labels: tuple[Label, ...]
    begin_s: float
    end_s: float


@functools.cache
def plans(series: int) -> tuple[EgoPlan, ...]:
    """Return what the stand-in drives, drawn by a seed."""
    random = np.random.default_rng(series)
    found = []
    for seed in range(PLANS):
        turn = ("straight", "left", "right")[seed % 3]
        heading = float(random.choice([0.0, 90.0, 180.0, 270.0]))
        change = str(random.choice(["", "", "left", "right"])) if lanes_beside(heading) else ""
        # Inner and outer lanes of an approach are those of the turns that they are for.
        if (turn == "left" and change == "right") or (turn == "right" and change == "left"):
            change = ""
        if turn == "straight" and change:
            change = "left"
        found.append(
            EgoPlan(
                heading,
                turn,
                float(random.uniform(8.0, 12.5)),
                change,
                bool(random.random() < 0.35),
                seed,
                _SKEW_DEG[series],
            )
        )
    return tuple(found)


def staged(number: int, *, series: int) -> Staged:
    """Return one of the drives; casts that are a matter of opinion are drawn again."""
    ego = drive(plans(series)[number % PLANS])
    begin, end = record_span(ego)
    random = np.random.default_rng([series, number])
    actors: list[Actor] = []
    while not actors:
        actors = _cast(ego, random)
    labels = own_labels(ego, begin, end)
    for actor in actors:
        for one in actor.labels:
            # Who is followed may be so from the record's beginning on; all else begins in it.
            whole = begin + 1.0 < one.begin_s or (one.kind == "following" and begin <= one.begin_s)
            if not (whole and one.end_s <= end):
                return staged(number + 100_000, series=series)
            labels.append(one)
    return Staged(ego, tuple(actors), tuple(labels), begin, end)


def _cast(ego: Drive, random: Random) -> list[Actor]:
    """Return one who crosses or turns, one along the way, and two with whom nothing happens."""
    plan, two_lanes = ego.plan, lanes_beside(ego.plan.from_deg) and not ego.plan.change
    across = ["from_left", "from_right", "oncoming"] if plan.turn == "straight" else []
    across += ["from_left", "oncoming"] if plan.turn == "left" else []
    across += ["on_foot", "by_bicycle"]
    along = ["lead", "parked", ""]
    along += [*["cut_in", "cut_out"] * 4, "overtakes_ego", "ego_overtakes"] if two_lanes else []
    along += ["standing", "standing"] if plan.stops else []
    nothing = ["late", "walker", "far", "follower"]
    nothing += ["passing"] if plan.turn != "left" else []
    nothing += ["keeps"] if two_lanes else []
    found: list[Actor | None] = [_across(ego, random, str(random.choice(across)))]
    what = str(random.choice(along))
    if what:
        found.append(_along(ego, random, what))
    crowded = ("keeps", "walker", "far") if what in ("overtakes_ego", "cut_in") else ()
    found += [
        _nothing(ego, random, str(name))
        for name in random.choice(nothing, 2, replace=False).tolist()
        if name not in crowded
    ]
    return [] if any(one is None for one in found) else [one for one in found if one is not None]


def _across(ego: Drive, random: Random, what: str) -> Actor:
    turn = ego.plan.turn
    if what == "from_left":
        return crosser(
            ego,
            random,
            name="across",
            kind="crossing_from_left",
            from_deg=-90.0,
            turn="straight",
            speed=(6.0, 12.0),
        )
    if what == "from_right":
        return crosser(
            ego,
            random,
            name="across",
            kind="crossing_from_right",
            from_deg=90.0,
            turn="straight",
            speed=(6.0, 12.0),
        )
    if what == "oncoming" and turn == "straight":
        return crosser(
            ego,
            random,
            name="across",
            kind="oncoming_turns_across",
            from_deg=180.0,
            turn="left",
            speed=(5.0, 7.0),
        )
    if what == "oncoming":
        return crosser(
            ego,
            random,
            name="across",
            kind="ego_turns_across_oncoming",
            from_deg=180.0,
            turn="straight",
            speed=(7.0, 12.0),
        )
    return on_foot(
        ego, random, name="across", kind="pedestrian" if what == "on_foot" else "bicycle"
    )


def _along(ego: Drive, random: Random, what: str) -> Actor | None:
    match what:
        case "lead":
            return lead(ego, random, name="along")
        case "cut_in" | "cut_out":
            return lead(ego, random, name="along", cut=what)
        case "parked":
            return beside(ego, random, name="along", near=True)
        case "standing":
            return standing(ego, random, name="along")
        case _:
            return neighbour(ego, random, name="along", kind=what)


def _nothing(ego: Drive, random: Random, what: str) -> Actor:
    match what:
        case "late":
            side = float(random.choice([-90.0, 90.0]))
            late_s = float(random.choice([-1.0, 1.0])) * 9.0
            turn = ego.plan.turn
            # Who crosses while the car comes to a stop is met, by the one or the other's book.
            if ego.plan.stops or turn == "right" or (turn == "left" and side > 0.0):
                return walker(ego, random, name="late")
            return crosser(
                ego,
                random,
                name="late",
                kind="",
                from_deg=side,
                turn="straight",
                speed=(6.0, 12.0),
                late_s=late_s,
            )
        case "walker":
            return walker(ego, random, name="walker")
        case "far":
            return beside(ego, random, name="far", near=False)
        case "follower":
            return follower(ego, random, name="follower")
        case "keeps":
            return neighbour(ego, random, name="keeps", kind="")
        case _:
            return _passing(ego)


def _passing(ego: Drive) -> Actor:
    """Return one who comes towards the car in its own lane, beside the car's."""
    line, _, _ = way_line(ego.plan.world, ego.plan.from_deg + 180.0, "straight")
    at_s = float(np.interp(ego.entry_m, ego.arc_m, ego.time_s)) + 7.0 * (ego.plan.turn == "right")
    xy = on_line(line, 130.0 + 9.0 * (ego.time_s - at_s + 1.5))
    return Actor("passing", "car", CAR_M, xy)


def detections(one: Staged, number: int, *, series: int) -> list[Detected]:
    """Return what a sensor makes of who was there: noise, holes, other ids after long ones, and
    things that are not there."""
    random = np.random.default_rng([1900 + series, number])
    time = one.drive.time_s
    ego = _ego_places(one.drive)
    rows = np.flatnonzero((time >= one.begin_s) & (time <= one.end_s))
    found: list[Detected] = []
    for actor in one.actors:
        seen = rows[np.isfinite(actor.xy_m[rows, 0])]
        seen = seen[np.hypot(*(actor.xy_m[seen] - ego[seen]).T) <= SEEN_WITHIN_M]
        if not len(seen):
            continue
        kept = seen[random.random(len(seen)) >= MISSED_SHARE]
        pieces = [kept]
        if random.random() < BURST_CHANCE:
            begin = random.uniform(time[seen[0]], time[seen[-1]])
            end = begin + random.uniform(*BURST_S)
            pieces = [kept[time[kept] < begin], kept[time[kept] > end]]
        for part, piece in enumerate(pieces):
            if len(piece):
                noisy = actor.xy_m[piece] + random.normal(0.0, POSITION_STD_M, (len(piece), 2))
                name = f"{actor.name}#{part}"
                found.append(_said(name, actor.kind, actor.size_m, time[piece], noisy))
    for ghost in range(int(random.poisson(GHOSTS))):
        first = int(random.choice(rows))
        count = max(int(random.uniform(*GHOST_S) * 10), 1)
        there = rows[(rows >= first) & (rows < first + count)]
        place = ego[first] + random.uniform(-25.0, 25.0, 2)
        noisy = place + random.normal(0.0, GHOST_STD_M, (len(there), 2))
        found.append(_said(f"ghost{ghost}", "car", None, time[there], noisy))
    if random.random() < CLUTTER_CHANCE:
        first = int(random.choice(rows))
        there = rows[(rows >= first) & (rows < first + int(random.uniform(*CLUTTER_S) * 10))]
        noisy = ego[first] + [0.0, 0.0] + random.normal(0.0, POSITION_STD_M, (len(there), 2))
        index = min(first + 30, len(ego) - 1)
        way = ego[index] - ego[first]
        long = float(np.hypot(*way))
        if long > 5.0:
            left = np.array([-way[1], way[0]]) / long * float(random.choice([-8.0, 8.0]))
            found.append(_said("pole", "unknown", (0.4, 0.4), time[there], noisy + left + way))
    return found


def _said(
    name: str, kind: str, size: tuple[float, float] | None, time: Array, xy: Array
) -> Detected:
    stamps = START_STAMP_NS + np.round(time * 1e9).astype(np.int64)
    return Detected(name, kind, size, stamps, xy, np.full(len(xy), np.nan))


def _ego_places(ego: Drive) -> Array:
    return on_line(ego.line, ego.arc_m)
