"""`foretwin scenarios place`: where scenarios take place on a map, and why not elsewhere."""

from __future__ import annotations

import collections
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import NamedTuple

import msgspec

from foretwin.contracts.errors import UserError
from foretwin.contracts.exit_codes import DONE, PARTLY
from foretwin.contracts.scenario import Scenario
from foretwin.contracts.terminal import say
from foretwin.orchestrator.commands.output import print_table
from foretwin.orchestrator.commands.progress_bar import progress_bar
from foretwin.orchestrator.commands.told import CommandResult
from foretwin.orchestrator.worlds.choice import choose_junctions
from foretwin.sim_worker.futures.ego_dry_run import rehearsal_stage
from foretwin.sim_worker.futures.playable import places
from foretwin.sim_worker.futures.scene import SceneMaker
from foretwin.sim_worker.scenarios.places import Unplaced
from foretwin.sim_worker.scenarios.reading import catalogue, find_scenario
from foretwin.sim_worker.vehicle.parameters import load_vehicle
from foretwin.world_gen.build import build_world
from foretwin.world_gen.junctions.intersections import Junction
from foretwin.world_gen.junctions.map_index import index_map
from foretwin.world_gen.opening import OpenMap

RADIUS_M = 150.0


class PlacedScenario(msgspec.Struct, kw_only=True):
    """Where one scenario takes place among the junctions that were looked at.

    `places` names, by junction, the connections of the first place there; `cases` counts those
    drawn there, `playable` how many of them can be played, `not_playable` the others by reason.
    `unplaced` tells why junctions that it applies to have no place, `does_not_apply` counts the
    others.
    """

    id: str
    title: str
    source: str
    looked_at: int = 0
    applies: int = 0
    placed: int = 0
    cases: int = 0
    playable: int = 0
    not_playable: dict[str, int] = {}
    places: dict[str, str] = {}
    unplaced: dict[str, str] = {}
    does_not_apply: dict[str, int] = {}


class PlacesAsked(NamedTuple):
    """What was asked for on the command line, as it was typed."""

    map_file: Path
    scenarios: Sequence[str] = ()
    junction_id: str | None = None
    at: str | None = None
    service_roads: bool = False


def place_scenarios(request: PlacesAsked) -> CommandResult:
    """Return where scenarios take place on a map's junctions, and why not elsewhere.

    Its code is 3 where one takes place nowhere though it was named, or applies to a junction.
    """
    chosen = [find_scenario(name) for name in request.scenarios] or list(catalogue().values())
    opened, junctions = asked_junctions(request)
    with progress_bar(len(junctions), "junctions") as (advance, _):
        found = placed_on(opened, junctions, chosen, advance=advance)
    named = bool(request.scenarios)
    nowhere = [row.id for row in found if not row.placed and (row.applies or named)]

    def words() -> None:
        _print_table(request.map_file, found)
        if nowhere:
            say(f"placed nowhere: {', '.join(nowhere)}")

    return CommandResult(found, words, PARTLY if nowhere else DONE)


def asked_junctions(request: PlacesAsked) -> tuple[OpenMap, tuple[Junction, ...]]:
    """Open as much of a map as is needed; returns it and the junctions that were asked for."""
    if request.at is not None and request.junction_id is not None:
        raise UserError("name the junction by --at LAT,LON or by --id ID, not by both")
    opened, junctions = choose_junctions(
        request.map_file,
        at=request.at,
        junction_id=request.junction_id,
        radius_m=RADIUS_M,
        service_roads=request.service_roads,
    )
    if not junctions:
        raise UserError(f"{opened.file}: no intersection in this map")
    return opened, junctions


def placed_on(
    opened: OpenMap,
    junctions: Sequence[Junction],
    scenarios: Sequence[Scenario],
    *,
    advance: Callable[[str], None] = lambda _: None,
) -> list[PlacedScenario]:
    """Return where scenarios take place on junctions of a map: one place for each is enough.

    `advance` is told each junction that has been looked at.
    """
    found = [PlacedScenario(id=s.id, title=s.title, source=s.source) for s in scenarios]
    index = index_map(opened.osm, opened.graph, opened.junctions)
    stage = rehearsal_stage(load_vehicle())
    for junction in junctions:
        world = build_world(opened.osm, opened.graph, junction, radius_m=RADIUS_M, index=index)
        scenes = SceneMaker(world)
        for scenario, row in zip(scenarios, found, strict=True):
            result = places(scenario, world, scenes=scenes, stage=stage, most=1)
            row.looked_at += 1
            for place, cases in zip(result.places, result.cases, strict=True):
                row.placed += 1
                row.places[place.junction_id] = place.name
                row.cases += len(cases)
                reasons = [case.reason for case in cases if isinstance(case, Unplaced)]
                row.playable += len(cases) - len(reasons)
                for reason in reasons:
                    row.not_playable[reason] = row.not_playable.get(reason, 0) + 1
            for unplaced in result.unplaced:
                if unplaced.applies:
                    row.unplaced[unplaced.junction_id] = unplaced.reason
                else:
                    count = row.does_not_apply.get(unplaced.reason, 0)
                    row.does_not_apply[unplaced.reason] = count + 1
        advance(junction.summary.id)
    for row in found:
        row.applies = row.placed + len(row.unplaced)
    return found


def _print_table(map_file: Path, found: list[PlacedScenario]) -> None:
    from rich.table import Column

    rows = []
    for row in found:
        reasons = collections.Counter(row.unplaced.values())
        lines = [f"{count} unplaced: {reason}" for reason, count in reasons.most_common()]
        others = sorted(row.does_not_apply.items(), key=lambda item: -item[1])
        lines += [f"{count}: {reason}" for reason, count in others]
        cases = sorted(row.not_playable.items(), key=lambda item: -item[1])
        lines += [f"{count} cases: {reason}" for reason, count in cases]
        played = f"{row.playable} of {row.cases}"
        rows.append((row.id, row.placed, row.applies, row.looked_at, played, "; ".join(lines)))
    columns = (
        Column("id", no_wrap=True),
        "placed",
        "applies to",
        "of",
        "playable cases",
        "why not",
    )
    print_table(str(map_file), columns, rows)
