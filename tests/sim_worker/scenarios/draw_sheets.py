"""Draws the picture sheets of docs/scenarios: every scenario on three junctions.

`python -m tests.sim_worker.scenarios.draw_sheets DATA OUT` reads the maps of the data folder.
Junctions are drawn by a seed, one of each of the first three maps where the scenario takes place,
and of others where it does not; what no map holds is shown in a drawn World.
"""

from __future__ import annotations

import argparse
import functools
import io
import random
import textwrap
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure
from PIL import Image
from PIL.PngImagePlugin import PngInfo

from foretwin.contracts.scenario import Scenario
from foretwin.contracts.world import ATTRIBUTION, World
from foretwin.sim_worker.futures.case_picture import (
    EGO,
    IMPACT,
    OTHERS,
    PLANNED,
    STANDING,
    caption,
    draw_case,
    draw_case_legend,
)
from foretwin.sim_worker.futures.case_picture_runs import heedless_run, planned_run
from foretwin.sim_worker.futures.playable import places
from foretwin.sim_worker.scenarios.casting import StagedCase
from foretwin.sim_worker.scenarios.drawing import draw_cases
from foretwin.sim_worker.scenarios.reading import catalogue
from foretwin.sim_worker.vehicle.parameters import load_vehicle
from foretwin.world_gen.build import build_world
from foretwin.world_gen.export.picture_style import (
    GROUND,
    ISLAND,
    JUNCTION,
    ROAD,
    SIDEWALK,
    View,
    view_around,
)
from foretwin.world_gen.junctions.find_intersections import find_intersections
from foretwin.world_gen.junctions.map_index import index_map
from foretwin.world_gen.osm.read_osm import read_map
from foretwin.world_gen.roads.build_graph import build_road_graph
from tests.sim_worker.scenarios.worlds import ego_alone, motorway, race_track

SEED = 11
MAPS = {
    "Berlin": "osm-berlin-mitte/berlin-mitte.osm",
    "Bad Hersfeld": "osm-badhersfeld/badhersfeld.osm.xml.gz",
    "Monaco": "osm-monaco/monaco.osm.gz",
    "Kingsway": "osm-kingsway/kingsway_junction.osm",
    "Liechtenstein": "osm-liechtenstein/liechtenstein-latest.osm.pbf",
    "Testfeld Niedersachsen": "osm-testfeld-nds/TestfeldNDS_main_roads.osm.xml.gz",
}
SHEETS = {
    "crossing": ("scp", "cccscp", "red_light", "emergency_vehicle"),
    "across": ("ccftap", "ltap_od", "ltip", "rtip"),
    "on-foot": ("cpta", "cbta", "occluded_pedestrian", "reversing_parking"),
    "roundabout-and-lead": ("roundabout_entry", "roundabout_exit", "lead_stopping", "low_friction"),
    "faults": ("brake_fault", "steering_fault", "gnss_offset", "latency"),
    "beyond": ("lost_detections", "overtaking_motorway", "race_track_lap"),
}
TILES, TRIES, MOST_AT_ONE_JUNCTION = 3, 60, 4
MOST_OFF_M = 5.0
"""Nobody starts so far beyond the end of what a World holds of a road."""
PLANNERS = {"reversing_parking": "reverse_pursuit"}
"""Who drives the ego where the usual planner cannot."""
TYPICAL = {"roundabout_entry": "roundabout", "roundabout_exit": "roundabout"}
"""Kinds that show best what a scenario is; it takes place on others, too."""
EXACT = (
    "white", "black", EGO, IMPACT, OTHERS, PLANNED, STANDING, GROUND, ISLAND, JUNCTION, ROAD,
    SIDEWALK,
)  # fmt: skip
_TILE_IN, _CAPTION_IN, _HEAD_IN, _FOOT_IN = (5.0, 4.1), 0.78, 0.62, 0.55


class Tile(NamedTuple):
    """One case on a sheet."""

    where: str
    world: World
    played: StagedCase


def worlds_of(file: Path) -> Iterator[World]:
    """Build the Worlds of a map's junctions in the order in which they are drawn."""
    osm = read_map(file)
    graph = build_road_graph(osm)
    junctions = sorted(find_intersections(osm, graph), key=lambda j: j.summary.id)
    index = index_map(osm, graph, tuple(junctions))
    random.Random(SEED).shuffle(junctions)
    # Rare kinds come early, or none of them would be among the first.
    count = Counter(junction.summary.kind for junction in junctions)
    seen: Counter[str] = Counter()
    turns = []
    for junction in junctions:
        kind = junction.summary.kind
        turns.append((seen[kind] * count[kind] / len(junctions), junction))
        seen[kind] += 1
    for _, junction in sorted(turns, key=lambda turn: turn[0])[:TRIES]:
        yield build_world(osm, graph, junction, index=index)


def choose_tiles(data: Path) -> dict[str, list[Tile]]:
    """Return three tiles of each scenario, of three maps where there are."""
    tiles: dict[str, list[Tile]] = {id_: [] for id_ in catalogue()}
    drawn = {"overtaking_motorway": motorway(), "race_track_lap": race_track()}
    for name, file in MAPS.items():
        # One of each map, but for the last, which is there to fill up.
        most = TILES if name == list(MAPS)[-1] else 1
        missing = {id_: most for id_, found in tiles.items() if len(found) < TILES}
        missing.pop("race_track_lap", None)
        for world in worlds_of(data / file):
            taken = 0
            for id_ in sorted(missing, key=lambda one: random.Random(f"{world.id} {one}").random()):
                tile = tile_of(catalogue()[id_], world, name)
                if tile is None or taken >= MOST_AT_ONE_JUNCTION:
                    continue
                tiles[id_].append(tile)
                taken += 1
                missing[id_] -= 1
                if not missing[id_] or len(tiles[id_]) >= TILES:
                    missing.pop(id_)
            if not missing:
                break
        print(f"{name}: without {', '.join(missing) or 'none'}", flush=True)
    for id_, world in drawn.items():
        if not tiles[id_]:
            tile = tile_of(catalogue()[id_], world, "")
            assert tile is not None
            tiles[id_].append(tile._replace(where="drawn, since none of the maps has one"))
    return tiles


def tile_of(scenario: Scenario, world: World, where: str) -> Tile | None:
    """Return a case of a scenario in a World, the middle one if that can be played.

    Of several places that counts whose roads the World holds farthest.
    """
    vehicle = load_vehicle()
    if TYPICAL.get(scenario.id, world.intersection.kind) != world.intersection.kind:
        return None
    drawn = draw_cases(scenario)
    found = places(scenario, world, vehicle=vehicle, cases=[drawn[len(drawn) // 2]], most=4)
    played = [case for (case,) in found.cases if isinstance(case, StagedCase)]
    best = min(played, key=lambda case: round(case.off_lanes_m / 5.0), default=None)
    if best is None or best.off_lanes_m > MOST_OFF_M:
        return None
    name = textwrap.shorten(f"{where}: {world.intersection.name or world.intersection.id}", 72)
    return Tile(name, world, best)


def whole_lap(tile: Tile, aspect: float) -> View:
    low, high = tile.played.place.ego.xy_m.min(axis=0), tile.played.place.ego.xy_m.max(axis=0)
    half_m = max(high[1] - low[1], (high[0] - low[0]) / aspect) / 2.0 + 10.0
    return view_around((low + high) / 2.0, half_m, aspect, close=False)


def draw_sheet(ids: tuple[str, ...], tiles: dict[str, list[Tile]], usual: str) -> Figure:
    """Draw one row for each scenario, its title above three tiles; `usual` is who drives."""
    vehicle = load_vehicle()
    wide, high = _TILE_IN
    row_in = high + _CAPTION_IN + _HEAD_IN
    width, height = TILES * (wide + 0.1) + 0.1, len(ids) * row_in + _FOOT_IN
    figure = Figure(figsize=(width, height), dpi=100, facecolor="white")
    for row, id_ in enumerate(ids):
        scenario = catalogue()[id_]
        planner = PLANNERS.get(id_, usual)
        top = 1.0 - row * row_in / height
        figure.text(0.1 / width, top - 0.24 / height, f"{id_}: {scenario.title}", fontsize=14,
                    weight="bold", va="center")  # fmt: skip
        figure.text(0.1 / width, top - 0.48 / height, scenario.shows, fontsize=10.5, va="center")
        for column, tile in enumerate(tiles[id_]):
            left = (0.1 + column * (wide + 0.1)) / width
            bottom = top - (_HEAD_IN + high) / height
            axes = figure.add_axes((left, bottom, wide / width, high / height))
            alone = functools.partial(ego_alone, tile.played, scenario, tile.world)
            heedless = heedless_run(tile.played, vehicle, alone, horizon_s=scenario.horizon_s)
            planned = planned_run(tile.played, scenario, tile.world, vehicle, planner=planner)
            draw_case(
                axes, tile.played, tile.world, heedless, planned, aspect=wide / high,
                view=whole_lap(tile, wide / high) if scenario.where.setting == "circuit" else None,
            )  # fmt: skip
            words = f"{tile.where}\n{caption(tile.played, heedless, planned, planner)}"
            figure.text(left, bottom - 0.05 / height, words, fontsize=8.8, va="top",
                        linespacing=1.15)  # fmt: skip
            print(f"{id_} | {words}".replace("\n", " | "), flush=True)
    draw_case_legend(figure, "the planner")
    attribution = {tile.world.attribution for id_ in ids for tile in tiles[id_]}
    figure.text(0.995, 0.012, "; ".join(sorted(attribution)), fontsize=11, ha="right",
                weight="bold")  # fmt: skip
    return figure


def save(figure: Figure, file: Path) -> None:
    """Write a figure as PNG with a palette, a third of the size; the colours that matter stay."""
    buffer = io.BytesIO()
    FigureCanvasAgg(figure).print_figure(buffer, format="png")
    image = Image.open(buffer).convert("RGB")
    exact = [round(255 * part) for colour in EXACT for part in to_rgb(colour)]
    common = image.quantize(160, dither=Image.Dither.NONE).getpalette() or []
    palette = Image.new("P", (1, 1))
    palette.putpalette(exact + common)
    about = PngInfo()
    about.add_text("Copyright", ATTRIBUTION.replace("©", "(c)"))
    reduced = image.quantize(palette=palette, dither=Image.Dither.NONE)
    reduced.save(file, optimize=True, pnginfo=about)
    print(f"{file}: {file.stat().st_size / 1000:.0f} kB")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("data", type=Path, help="folder of the maps")
    parser.add_argument("out", type=Path, help="folder to write to")
    parser.add_argument("--sheet", choices=SHEETS, help="only this one")
    parser.add_argument("--planner", default="pure_pursuit_idm", help="who drives the ego")
    asked = parser.parse_args()
    assert sorted(id_ for ids in SHEETS.values() for id_ in ids) == sorted(catalogue())
    tiles = choose_tiles(asked.data)
    asked.out.mkdir(parents=True, exist_ok=True)
    for name, ids in SHEETS.items():
        if asked.sheet in (None, name):
            save(draw_sheet(ids, tiles, asked.planner), asked.out / f"{name}.png")


if __name__ == "__main__":
    main()
