"""The mirror image of a drawn junction, for a country that drives on the other side."""

from __future__ import annotations

import dataclasses
from pathlib import Path

from foretwin.contracts.frames import LocalFrame
from foretwin.world_gen.countries.outlines import place_at
from tests.data.junctions.draw import drawings
from tests.data.junctions.drawing import BREMEN, LEEDS, Drawing
from tests.world_gen.transformed_maps import OTHER, SIDES, mirrored_tags
from tests.world_gen.truth_sheet import TrueJunction, TrueMap

STEM_WAITS = {
    "16_dead_end_nearby",
    "23_signals_at_node",
    "29_right_before_left",
    "33_contraflow_for_bicycles",
    "35_tunnel_under",
    "36_service_roads",
    "45_parking_lanes",
}
"""T junctions of equal streets without signs: right before left holds in Germany; in England who
comes out of the side road waits for the road that goes on (Highway Code 170)."""


def mirrored_drawings(folder: Path) -> dict[str, Path]:
    """Write the mirror image of every drawing, east for west, and return the files by name."""
    files = {}
    for name, drawing in drawings():
        files[name] = folder / f"{name}.osm"
        _mirrored(drawing).write(files[name])
    return files


def mirrored_truth(truth: TrueMap, osm_file: Path) -> TrueMap:
    """Return what must be true of the mirror image: left for right, and the same priorities.

    The stem of a T without signs alone is another matter: see `STEM_WAITS`.
    """
    return dataclasses.replace(
        truth,
        osm_file=osm_file,
        drives=OTHER[truth.drives],
        junctions=tuple(
            _mirrored_junction(junction, stem="S" if truth.name in STEM_WAITS else None)
            for junction in truth.junctions
        ),
    )


def _mirrored_junction(junction: TrueJunction, stem: str | None) -> TrueJunction:
    waiting = dict(junction.waiting)
    for pair in waiting:
        from_stem = frozenset(movement for movement in pair if movement[0] == stem)
        if len(from_stem) == 1:
            waiting[pair] = from_stem
    return dataclasses.replace(
        junction,
        waiting=waiting,
        ring=OTHER[junction.ring] if junction.ring else None,
        turns={
            movement: OTHER.get(turn, turn) if turn else None
            for movement, turn in junction.turns.items()
        },
    )


def _mirrored(drawing: Drawing) -> Drawing:
    origin = drawing.frame.origin
    keeps_left = place_at(origin.lat_deg, origin.lon_deg).driving_side == "left"
    image = Drawing(BREMEN if keeps_left else LEEDS)
    assert image.frame != LocalFrame(origin)
    image.nodes = {
        (-x_m, y_m): (number, mirrored_tags(tags))
        for (x_m, y_m), (number, tags) in drawing.nodes.items()
    }
    image.ways = [(number, refs, mirrored_tags(tags)) for number, refs, tags in drawing.ways]
    image.relations = [SIDES.sub(lambda m: OTHER[m[0]], text) for text in drawing.relations]
    return image
