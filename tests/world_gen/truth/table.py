"""The table: foretwin and netconvert against every truth, in one form."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from foretwin.contracts.arrays import Array
from foretwin.contracts.frames import LocalFrame
from tests.benchmarks.measuring import UnavailableError
from tests.world_gen.truth.argoverse import argoverse_maps
from tests.world_gen.truth.berlin import berlin_truth, drives_without_map
from tests.world_gen.truth.driven_again import Again, driven_again, simulated_again
from tests.world_gen.truth.generators import RECOMMENDED, by_foretwin, by_netconvert
from tests.world_gen.truth.hd_map import HdMap
from tests.world_gen.truth.karlsruhe import karlsruhe_map
from tests.world_gen.truth.lane_model import LaneModel, of_hd_map
from tests.world_gen.truth.mcity import drawn_map, mcity_passes
from tests.world_gen.truth.reduced_map import reduced
from tests.world_gen.truth.registration import laid_on
from tests.world_gen.truth.scores import map_score
from tests.world_gen.truth.tracks import beside, corner_radii_m, corner_radius_m, extended

LEAST_TO_LAY = 20
"""Fewer tracks tell nothing of how their recorder and the map differ."""


class Row(NamedTuple):
    """One figure of one generator on one truth."""

    truth: str
    measure: str
    generator: str
    text: str


def rows(data: Path, work: Path) -> Iterator[Row]:
    """Measure everything; maps are written into the folder `work`."""
    maps = [
        karlsruhe_map(data / "traffic-karlsruhe-k729"),
        *argoverse_maps(data / "map-av2-pittsburgh"),
    ]
    for hd in maps:
        map_file = work / f"{hd.name.replace(' ', '-')}.osm"
        map_file.write_text(reduced(hd), encoding="utf-8")
        models = [*_models(map_file, hd.frame, work), of_hd_map(hd)]
        for model in models:
            yield from _map_rows(hd, model)
        tracks = [t.xy_m for t in hd.tracks]
        yield from _track_rows(hd.name, "track", models, tracks)
        if len(tracks) >= LEAST_TO_LAY:
            move = laid_on(models[-1], tracks)
            moved = [move.of(xy_m) for xy_m in tracks]
            yield from _track_rows(hd.name, "laid track", models, moved)
        yield from _driven_turns(hd)
    berlin = berlin_truth(data)
    models = list(_models(berlin.map_file, berlin.frame, work))
    yield from _track_rows("berlin", "track", models, berlin.tracks, berlin.within_m)
    for model in models:
        yield _radii_row("berlin", model)
    driven = {"berlin": berlin.whole_m} | drives_without_map(data)
    for name, xy_m in driven.items():
        radii = np.array(corner_radii_m(xy_m, left=False))
        yield Row(name, "near-side radius, m", "tracks", quartiles(radii))
    once = once_driven(data, work)
    for name, again in once.passes.items():
        yield from _again_rows(name, again)
    for column, name in enumerate(("foretwin", "driven once")):
        text = quartiles(once.lanes_m[:, column])
        yield Row("berlin, simulated", "lanes that moved, m", name, text)
    away_m = once.lanes_m[:, 1] - once.lanes_m[:, 0]
    text = f"by more than 0.5 m {(away_m > 0.5).sum()}, 1 m {(away_m > 1.0).sum()}"
    yield Row("berlin, simulated", "lanes moved away", "driven once", text)


class OnceDriven(NamedTuple):
    """Other passes by name, and (L, 2) how far simulated lanes lay from their true place."""

    passes: dict[str, Again]
    lanes_m: Array


def once_driven(data: Path, work: Path) -> OnceDriven:
    """Return how lanes corrected by one earlier pass fit other passes of the same road."""
    mcity = mcity_passes(data / "traffic-mcity-rtk")
    drawn = work / "mcity.osm"
    drawn.write_text(drawn_map(), encoding="utf-8")
    karlsruhe = karlsruhe_map(data / "traffic-karlsruhe-k729")
    file = work / "karlsruhe-again.osm"
    file.write_text(reduced(karlsruhe), encoding="utf-8")
    berlin = berlin_truth(data)
    simulated, lanes_m = simulated_again(berlin.map_file, berlin.frame, work)
    passes = {
        "karlsruhe": driven_again(karlsruhe, file),
        "mcity": driven_again(mcity, drawn),
        "berlin, simulated": simulated,
    }
    return OnceDriven(passes, lanes_m)


def _again_rows(truth: str, again: Again) -> Iterator[Row]:
    known = ~np.isnan(again.before_m) & ~np.isnan(again.after_m)
    for word, asked in (("straight", ~again.turning), ("turning", again.turning)):
        for name, away_m in (("foretwin", again.before_m), ("driven once", again.after_m)):
            text = quartiles(away_m[known & asked])
            yield Row(truth, f"other pass, {word}, m", name, text)


def _models(map_file: Path, frame: LocalFrame, work: Path) -> Iterator[LaneModel]:
    yield by_foretwin(map_file, frame)
    try:
        yield by_netconvert(map_file, frame, work)
        yield by_netconvert(map_file, frame, work, *RECOMMENDED)
    except UnavailableError:
        return


def _map_rows(hd: HdMap, model: LaneModel) -> Iterator[Row]:
    score = map_score(hd, model)

    def row(measure: str, text: str) -> Row:
        return Row(hd.name, measure, model.name, text)

    yield row("lane offset, m", quartiles(score.offset_m))
    yield row("lane width error, m", quartiles(np.abs(score.width_m)))
    yield row("stop line beyond, m", quartiles(score.stop_line_m))
    yield row("connection path, m", quartiles(score.path_m))
    share = f"{score.found} of {score.movements}, {score.extra} more"
    yield row("movements", share)
    yield _radii_row(hd.name, model)


def _radii_row(truth: str, model: LaneModel) -> Row:
    sharp = [corner_radius_m(extended(c.line), left=False) for c in model.connections]
    radii = np.array([r for r in sharp if r is not None])
    return Row(truth, "near-side radius, m", model.name, quartiles(radii))


def _track_rows(
    truth: str,
    name: str,
    models: Sequence[LaneModel],
    tracks: list[Array],
    within: Array | None = None,
) -> Iterator[Row]:
    """Yield how far tracks lie from each model's lanes, where all models have one near."""
    found = [beside(model, tracks, within=within) for model in models]
    known = ~np.isnan([one.away_m for one in found]).any(axis=0)
    for word, asked in (("straight", ~found[0].turning), ("turning", found[0].turning)):
        for model, one in zip(models, found, strict=True):
            text = f"{quartiles(one.away_m[known & asked])}, {_known(one.away_m[asked])} near"
            yield Row(truth, f"{name}, {word}, m", model.name, text)


def _known(values: Array) -> str:
    return f"{int((~np.isnan(values)).sum())} of {len(values)}"


def _driven_turns(hd: HdMap) -> Iterator[Row]:
    radii = [corner_radius_m(track.xy_m, left=False) for track in hd.tracks]
    known = np.array([r for r in radii if r is not None])
    yield Row(hd.name, "near-side radius, m", "tracks", quartiles(known))


def quartiles(values: Array) -> str:
    """Return 10, 25, 50, 75 and 90 % of the values that are known, and how many these are."""
    known = values[~np.isnan(values)]
    if not len(known):
        return f"none of {len(values)}"
    parts = " ".join(f"{v:6.2f}" for v in np.percentile(known, (10, 25, 50, 75, 90)))
    return f"{parts}  ({_known(values)})"


def as_text(found: list[Row]) -> str:
    """Return the table, by truth and measure."""
    lines = ["10, 25, 50, 75, 90 % (known of looked at)", ""]
    for key in dict.fromkeys((row.truth, row.measure) for row in found):
        lines += [
            f"{row.truth:20} {row.measure:22} {row.generator:24} {row.text}"
            for row in found
            if (row.truth, row.measure) == key
        ]
    return "\n".join(lines)
