"""The sections of a run's junctions: what was foreseen at each, what came, what the map knew."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np
import pyarrow.compute as pc

from foretwin.contracts.arrays import Array
from foretwin.contracts.frames import local_from_geo
from foretwin.contracts.segments import MONITOR_FILE
from foretwin.contracts.terminal import command_line
from foretwin.contracts.world import World
from foretwin.orchestrator.report.blocks import (
    UNKNOWN,
    Block,
    Chapter,
    Drawn,
    Listed,
    Prose,
    TableCell,
    listed_words,
    number,
    plural,
    power,
    row,
    scientific,
)
from foretwin.orchestrator.report.junction_picture import is_touching, junction_svg
from foretwin.orchestrator.report.material import RunMaterial, TableRow
from foretwin.orchestrator.report.passages import JunctionPassed, WhatCame, tone_of, what_came
from foretwin.orchestrator.report.replayed import ReplayedRound, replayed
from foretwin.sim_worker.scenarios.reading import catalogue
from foretwin.world_gen.report.report import report_of

DRAWN = 24
"""So many junctions of a run are drawn: each costs some tenths of a second and 40 kB."""
_SHOWN_S = 8.0
_KMPH = 3.6
_OUTCOMES = {
    "agree_pass": "agree: passed",
    "agree_fail": "agree: failed",
    "too_pessimistic": "simulation too pessimistic",
    "too_optimistic": "simulation too optimistic",
    "not_observable": "not observable",
}


def junction_table(passed: Sequence[JunctionPassed], *, lock_step: bool) -> Listed:
    """Return all junctions of a run, one a row, each leading to its section."""
    ready = "“World ready before” is how long before the car came within its radius;"
    if lock_step:
        ready = "In lock step the drive waits for Worlds, so that none is late;"
    rows = [
        row(
            TableCell(str(one.number), order=one.number),
            TableCell(one.name, to=one.anchor),
            str(one.place.get("control") or UNKNOWN).replace("_", " "),
            number(one.arrived_s, 1, "s"),
            number(None) if lock_step else _ready(one),
            number(float(len(one.rounds)), 0),
            number(float(one.futures), 0),
            number(float(one.collided), 0),
            scientific(one.gravest, tone=tone_of(one.gravest)),
        )
        for one in passed
    ]
    return Listed(
        "Junctions, in the order in which the car came there",
        (
            "No.",
            "junction",
            "control",
            "reached",
            "World ready before",
            "rounds",
            "futures",
            "collide",
            "gravest",
        ),
        tuple(rows),
        frozenset({0, 3, 4, 5, 6, 7, 8}),
        note=f"{ready} “gravest” is the highest criticality foreseen: likelihood times the risk "
        "that somebody dies.",
    )


def _ready(one: JunctionPassed) -> TableCell:
    before_s = one.place.get("world_ready_before_s")
    if before_s is None or one.arrived_s is None:
        return number(None)
    return number(float(before_s), 1, "s", tone="watch" if before_s < 0.0 else "")


def junction_parts(
    run: RunMaterial, passed: Sequence[JunctionPassed], *, pictures: bool = True
) -> Iterator[Chapter]:
    """Yield a section for each junction, the first `DRAWN` of them with pictures."""
    for place, one in enumerate(passed):
        yield _junction(run, one, drawn=pictures and place < DRAWN)


def _junction(run: RunMaterial, one: JunctionPassed, *, drawn: bool) -> Chapter:
    came = what_came(run, one)
    blocks: list[Block] = [Prose(_foreseen(one)), Prose(_came(one, came))]
    world = None if one.shown_round is None else run.world(one.shown_round["world_id"])
    if world is not None and one.shown_round is not None and drawn:
        blocks.append(_picture(run, one, world))
    elif one.rounds and one.number > DRAWN:
        blocks.append(Prose(f"Only the first {DRAWN} junctions of a run are drawn.", "quiet"))
    elif one.rounds and drawn:
        blocks.append(
            Prose("No picture: the World of this junction is not in the run's folder.", "quiet")
        )
    for title, futures in (("Worst futures", one.worst), ("Likeliest futures", one.likeliest)):
        if futures:
            blocks.append(_futures(run, one, title, futures))
    if world is not None:
        blocks += _from_the_map(world, str(one.place["id"]))
    return Chapter(one.anchor, f"{one.number} · {one.name}", tuple(blocks))


def _foreseen(one: JunctionPassed) -> str:
    control = str(one.place.get("control") or "").replace("_", " ")
    kind = str(one.place.get("kind") or "junction").replace("_", " ")
    what = f"{kind.capitalize()}{f', {control}' if control and control != kind else ''}."
    if not one.rounds:
        return f"{what} No round was complete before the car was there: nothing was foreseen."
    first, last = one.rounds[0]["drive_time_s"], one.rounds[-1]["drive_time_s"]
    ahead = "" if one.arrived_s is None else f", the first {one.arrived_s - first:.0f} s ahead"
    text = (
        f"{what} {plural(len(one.rounds), 'round')} from {first:.1f} s to {last:.1f} s{ahead}, "
        f"with {plural(one.futures, 'future')}; {one.collided} of them collide."
    )
    if one.worst:
        worst = one.worst[0]
        text += (
            f" The gravest: {title_of(worst)}, criticality {power(worst['criticality'])} at "
            f"a likelihood of {power(worst['likelihood'])}"
        )
        if worst["collided"]:
            text += f", a collision after {worst['collision_time_s']:.1f} s"
        return text + "."
    return text + " None of them is critical."


def _came(one: JunctionPassed, came: WhatCame) -> str:
    if one.arrived_s is None:
        return "The car did not come to its centre before the drive ended."
    text = f"The car was there at {one.arrived_s:.1f} s"
    if came.speed_mps is not None and came.slowest_mps is not None:
        text += (
            f" with {came.speed_mps * _KMPH:.0f} km/h; its slowest in the 60 m before was "
            f"{came.slowest_mps * _KMPH:.0f} km/h"
        )
        if came.stood_s >= 1.0:
            text += f", and it stood for {came.stood_s:.0f} s"
    text += "."
    if came.errors_m:
        told = [f"{error:.1f} m over {horizon:g} s" for horizon, error in came.errors_m.items()]
        text += f" The nominal future lay {listed_words(told)} from what it drove, in mean."
    if came.outcomes:
        told = [f"{count} {_OUTCOMES.get(name, name)}" for name, count in came.outcomes.items()]
        text += f" The same seconds simulated and driven, judged: {listed_words(told)}."
    return text


def title_of(future: Mapping[str, Any]) -> str:
    """Return what happens in a future in words: its scenario's title, and what else differs from
    the nominal one."""
    title = scenario_of(future)
    rest = str(future["name"]).partition(future["scenario"] or title)[2].strip(" ,")
    return f"{title} ({rest})" if rest else title


def scenario_of(future: Mapping[str, Any]) -> str:
    """Return the title of a future's scenario, else what differs from the nominal one."""
    scenario = catalogue().get(future["scenario"] or "")
    return str(future["name"]) if scenario is None else scenario.title


def repeat_command(run: RunMaterial, future_id: str) -> str:
    """Return the command that plays a future again."""
    return command_line("repeat", run.called, future_id)


def _futures(
    run: RunMaterial, one: JunctionPassed, title: str, futures: Sequence[TableRow]
) -> Listed:
    at_s = {row["round_id"]: row["drive_time_s"] for row in one.rounds}
    rows = tuple(
        row(
            title_of(future),
            scientific(future["likelihood"]),
            scientific(future["criticality"], tone=tone_of(future["criticality"])),
            _end(future),
            number(future["min_clearance_m"], 1, "m"),
            number(at_s.get(future["round_id"]), 1, "s"),
            TableCell(repeat_command(run, future["future_id"]), code=True),
        )
        for future in futures
    )
    return Listed(
        title,
        (
            "future",
            "likelihood",
            "criticality",
            "ends",
            "clearance",
            f"in {MONITOR_FILE} at",
            "again",
        ),
        rows,
        frozenset({1, 2, 4, 5}),
    )


def _end(future: Mapping[str, Any]) -> str:
    if not future["collided"]:
        return f"{future['progress_m'] or 0.0:.0f}\u00a0m on"
    what = future["accident_kind"] or future["collision_with"] or "something"
    return (
        f"hits a {what}".replace("a static", "what stands")
        + f" after {future['collision_time_s']:.1f}\u00a0s"
    )


def _picture(run: RunMaterial, one: JunctionPassed, world: World) -> Drawn:
    assert one.shown_round is not None
    again = _play(run, one.shown_round["round_id"])
    at_s = one.shown_round["drive_time_s"]
    driven_m, seconds_m = _driven(run, world, at_s)
    words = [
        f"At {at_s:.1f} s: {plural(len(again.futures), 'future')} of that round, played again "
        "to the recorded hash"
        if again.futures
        else f"At {at_s:.1f} s; no future could be drawn",
        "blue the nominal one, green the others, amber and red the critical ones, violet whom they "
        "meet"
        if again.futures
        else "",
        "yellow where they touch" if any(map(is_touching, again.futures)) else "",
        f"black what the car did in the {_SHOWN_S:g} s after, a dot each second"
        if len(driven_m) > 1
        else "what the car did is not recorded",
        again.missing,
    ]
    svg = junction_svg(world, again.futures, driven_m, seconds_m)
    return Drawn(svg, "; ".join(word for word in words if word) + ".", wide=True)


def _play(run: RunMaterial, round_id: int) -> ReplayedRound:
    if run.futures is None:
        return ReplayedRound((), "; ".join(run.unread) or "no future was played", None)
    return replayed(run.folder, run.futures.filter(pc.field("round_id") == round_id).to_pylist())


def _driven(run: RunMaterial, world: World, from_s: float) -> tuple[Array, Array]:
    if run.track is None:
        return np.zeros((0, 2)), np.zeros((0, 2))
    some = run.track.between(from_s, from_s + _SHOWN_S)
    if len(some.time_s) < 2:
        return np.zeros((0, 2)), np.zeros((0, 2))
    xy = np.asarray(local_from_geo(world.frame, some.lat_lon_deg[:, 0], some.lat_lon_deg[:, 1]))
    seconds = np.arange(from_s, some.time_s[-1] + 1e-6, 1.0)
    at = np.column_stack([np.interp(seconds, some.time_s, column) for column in xy.T])
    return xy, at


def _from_the_map(world: World, junction_id: str) -> list[Block]:
    told = report_of(world)
    junction = next((one for one in told.junctions if one.id == junction_id), None)
    if junction is None:
        return []
    rows = tuple(
        row(
            subject.subject,
            *(
                number(float(count), 0)
                for count in (subject.tagged, subject.inferred, subject.default)
            ),
            number(subject.confidence, 2),
            "; ".join(subject.guessed[:3])
            + (f"; {len(subject.guessed) - 3} more" if len(subject.guessed) > 3 else ""),
        )
        for subject in junction.subjects
    )
    sure = "" if junction.confidence is None else f" (confidence {junction.confidence:.2f})"
    return [
        Listed(
            f"What the map said of it, and what was guessed{sure}",
            ("subject", "tagged", "inferred", "default", "confidence", "guessed"),
            rows,
            frozenset({1, 2, 3, 4}),
            folded=True,
        )
    ]
