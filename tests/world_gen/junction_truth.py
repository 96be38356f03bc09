"""Build a World of every drawn junction and print how far it agrees with the truth.

`python -m tests.world_gen.junction_truth` prints one line for each map, the sums, and every miss
in words; with names (or parts of them) as arguments, for those maps alone.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence

from foretwin.contracts.world import World
from foretwin.world_gen.build import build_world
from foretwin.world_gen.junctions.find_intersections import find_intersections
from foretwin.world_gen.osm.osm_map import MapError
from foretwin.world_gen.osm.read_osm import read_map
from foretwin.world_gen.roads.build_graph import build_road_graph
from tests.world_gen.data_maps import named
from tests.world_gen.junction_score import COLUMNS, Score, score
from tests.world_gen.truth_sheet import TrueJunction, TrueMap, true_maps


def worlds_of(truth: TrueMap) -> list[World]:
    """Return a World for every junction found in a drawn map, none where it has no roads."""
    osm = read_map(truth.osm_file)
    try:
        graph = build_road_graph(osm)
    except MapError:
        return []
    return [build_world(osm, graph, junction) for junction in find_intersections(osm, graph)]


def score_map(truth: TrueMap) -> Score:
    """Build all Worlds of a map and compare each with the junction that shares most roads."""
    total = Score()
    left = list(truth.junctions)
    worlds = worlds_of(truth)
    if not left:
        total.ask("arms", not worlds, "there is no junction, but one was found")
    for world in worlds:
        if not left:
            name = world.intersection.name
            total.ask("arms", False, f"invented a junction, {name}")
            continue
        best = max(left, key=lambda true: _shared(true, world))
        left.remove(best)
        side = world.intersection.driving_side
        total.ask("kind", side == truth.drives, f"drives on the {side}")
        total.add(score(best, world, world.junctions[0]))
    for missing in left:
        roads = ", ".join(arm.road for arm in missing.arms.values())
        for column, count in (
            ("arms", len(missing.arms)),
            ("lanes", 2 * len(missing.arms)),
            ("movements", len(missing.turns)),
            ("ring", int(missing.ring is not None)),
            ("yields", len(missing.waiting) + len(missing.entry_waits)),
        ):
            for _ in range(count):
                total.ask(column, False, f"there is no junction of {roads}")
    return total


def _shared(true: TrueJunction, world: World) -> int:
    found = {arm.name for arm in world.junctions[0].arms}
    return len(found & {arm.road for arm in true.arms.values()})


def table(scores: dict[str, Score]) -> str:
    """Return the table of all maps with its sums, misses below."""
    width = max(len(name) for name in (*scores, "all"))
    lines = [" ".join([" " * width, *(f"{column:>9}" for column in COLUMNS)])]
    total = Score()
    for name, found in scores.items():
        total.add(found)
        lines.append(_line(name, found, width))
    lines.append(_line("all", total, width))
    shares = (f"{100.0 * total.share(column):8.1f}%" for column in COLUMNS)
    lines.append(" ".join([" " * width, *shares]))
    for name, found in scores.items():
        lines += [f"{name}: {word}" for word in dict.fromkeys(found.misses)]
        if found.unlisted:
            lines.append(f"{name}: a conflict to one alone: {', '.join(found.unlisted)}")
    return "\n".join(lines)


def _line(name: str, found: Score, width: int) -> str:
    counts = (
        f"{found.right[c]}/{found.asked[c]}".rjust(9) if found.asked[c] else " " * 9
        for c in COLUMNS
    )
    return " ".join([name.ljust(width), *counts])


def main(wanted: Sequence[str]) -> None:
    """Score all maps, or those whose names hold one of the wanted words, and print the table."""
    every = {truth.name: truth for truth in true_maps()}
    print(table({name: score_map(every[name]) for name in named(wanted, every)}))


if __name__ == "__main__":
    main(sys.argv[1:])
