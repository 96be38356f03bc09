"""Draw every junction of this folder again: `python -m tests.data.junctions.draw`."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from tests.data.junctions import draw_control, draw_crossings, draw_lanes, draw_rings
from tests.data.junctions.drawing import BREMEN, Drawing

FOLDER = Path(__file__).parent


def drawings() -> Iterator[tuple[str, Drawing]]:
    """Yield every drawing with the name of its map."""
    for module in (draw_crossings, draw_rings, draw_control, draw_lanes):
        for name, entry in module.DRAWINGS.items():
            sketch, place = entry if isinstance(entry, tuple) else (entry, BREMEN)
            drawing = Drawing(place)
            sketch(drawing)
            yield name, drawing


def draw_all(folder: Path) -> None:
    """Write NN_name.osm for every drawing into a folder."""
    for name, drawing in drawings():
        drawing.write(folder / f"{name}.osm")


if __name__ == "__main__":
    draw_all(FOLDER)
