"""`python -m tests.placed [--most N] MAP...`: what is placed on maps, and how much is playable."""

from __future__ import annotations

import argparse
import collections
import json
import time
from collections.abc import Collection
from pathlib import Path

import numpy as np

from tests.placed.counted_places import WANTED, counted, found
from tests.placed.played_map import PlayedCase, PlayedJunction, PlayedMap, played_map
from tests.placed.raw_map import RawMap, read_raw


def main() -> None:
    """Print for each map, and for all, what was placed and what of it can be played."""
    parser = argparse.ArgumentParser(prog="python -m tests.placed", description=__doc__)
    parser.add_argument("maps", nargs="+", type=Path)
    parser.add_argument("--most", type=int, help="of a map's junctions, drawn by a seed")
    parser.add_argument("--kind", help="junctions of this kind alone, such as roundabout")
    parser.add_argument("--scenario", action="append", help="this one alone; may be given again")
    parser.add_argument("--counted", action="store_true", help="only where a scenario is counted")
    parser.add_argument("--part", default="1/1", help="K/N: of them, every Nth from the Kth on")
    parser.add_argument("--seed", type=int, default=7, help="of the draw")
    parser.add_argument("--cases", type=Path, help="where to write each case as a line of JSON")
    given = parser.parse_args()
    every: list[PlayedJunction] = []
    shares = collections.Counter[tuple[str, str]]()
    for file in given.maps:
        raw, start = read_raw(file), time.perf_counter()
        part = tuple(map(int, given.part.split("/")))
        at = set[int]().union(*counted(raw).values()) if given.counted else None
        result = played_map(
            file,
            raw,
            most=given.most,
            seed=given.seed,
            kind=given.kind,
            part=part,
            at=at,
            only=given.scenario,
        )
        junctions = result.junctions
        took_s = time.perf_counter() - start
        placing_s = sum(j.placing_s for j in junctions)
        print(f"\n{file.name}: {len(junctions)} junctions in {took_s:.0f} s")
        print(f"  placing took {placing_s:.1f} s of them")
        _print_cases([case for junction in junctions for case in junction.played])
        shares.update(_counts(raw, result, first_part=part[0] == 1, only=given.scenario))
        every += junctions
        if given.cases:
            with given.cases.open("a") as out:
                for case in (case for junction in junctions for case in junction.played):
                    out.write(json.dumps({"map": file.name, **case._asdict()}, default=str) + "\n")
    cases = [case for junction in every for case in junction.played]
    if len(given.maps) > 1:
        print("\nall maps")
        _print_cases(cases)
    print()
    _print_scenarios(every, cases)
    print("\nof the places counted from the raw map, those where it was placed")
    for id_ in WANTED:
        if applies := shares[id_, "applies"]:
            print(f"  {id_:20} {_share(shares[id_, 'placed'], applies)}")
    sums = [sum(n for (_, what), n in shares.items() if what == w) for w in ("placed", "applies")]
    print(f"  {'all':20} {_share(*sums)}")


def _counts(
    raw: RawMap, result: PlayedMap, *, first_part: bool, only: Collection[str] | None
) -> collections.Counter[tuple[str, str]]:
    """Return how often each scenario applies, as counted, and is placed there.

    Nodes of no junction that foretwin knows are missed in the first part of a map alone.
    """
    looked_at = {node for junction in result.junctions for node in junction.osm_nodes}
    counts = collections.Counter[tuple[str, str]]()
    for id_, nodes in counted(raw).items():
        if only and id_ not in only:
            continue
        placed = {n for j in result.junctions if id_ in j.placed for n in j.osm_nodes}
        known = result.known_nodes if first_part else result.known_nodes | nodes
        here = found(nodes, placed, looked_at, known)
        counts[id_, "applies"], counts[id_, "placed"] = here.applies, here.placed
        for node in here.missed:
            why = [j.unplaced.get(id_) for j in result.junctions if node in j.osm_nodes]
            print(f"    {id_} is not placed at node {node}: {why or 'no junction there'}")
    return counts


def _print_cases(cases: list[PlayedCase]) -> None:
    playable = sum(not case.verdict.against for case in cases)
    promised = [case.verdict for case in cases if case.verdict.promised]
    off = np.array([verdict.off_m for verdict in promised])
    came = int((off <= 0.1).sum())
    print(f"  {_share(playable, len(cases))} placed cases are playable")
    print(f"  {_share(came, len(off))} promised impacts come within 0.1 m")
    reasons = collections.Counter(reason for case in cases for reason in case.verdict.against)
    for reason, count in reasons.most_common():
        print(f"    {count:5} {reason}")


def _print_scenarios(every: list[PlayedJunction], cases: list[PlayedCase]) -> None:
    placed = collections.Counter(id_ for junction in every for id_ in junction.placed)
    for id_ in sorted({id_ for j in every for id_ in (*j.placed, *j.unplaced)}):
        mine = [case for case in cases if case.scenario_id == id_]
        playable = sum(not case.verdict.against for case in mine)
        why = [j.unplaced[id_] for j in every if id_ in j.unplaced]
        applies = placed[id_] + sum(applies for _, applies in why)
        print(
            f"{id_:20} {placed[id_]:4} of {applies:4} junctions, "
            f"{playable:4} of {len(mine):4} cases"
        )
        reasons = collections.Counter(reason for case in mine for reason in case.verdict.against)
        for reason, count in reasons.most_common(3):
            print(f"{'':22} {count:5} {reason}")
        for reason, count in collections.Counter(r for r, applies in why if applies).most_common(4):
            print(f"{'':22} {count:5} junctions without: {reason}")


def _share(part: int, whole: int) -> str:
    return f"{part} of {whole} ({100.0 * part / max(whole, 1):.1f} %)"


if __name__ == "__main__":
    main()
