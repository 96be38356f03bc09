"""Lights as rows: each head in its group's colour, faint where a plan alone says so."""

from __future__ import annotations

import numpy as np
import rerun as rr

from foretwin.contracts.arrays import Array
from foretwin.contracts.drive import SignalColour
from foretwin.contracts.frames import LocalFrame
from foretwin.contracts.lights import ShownLights
from foretwin.contracts.world import World
from foretwin.viewer.colours import CRITICAL, SAFE, WATCH, Colour
from foretwin.viewer.log_world import signal_tops
from foretwin.viewer.rows import Row

PATH = "world/lights"
COLOURS: dict[SignalColour, Colour] = {
    "red": CRITICAL,
    "red_amber": (245, 123, 42),
    "amber": WATCH,
    "green": SAFE,
}
FAINT = 0.4
"""Of the colour of a light that no map, no memory and nobody tells of: its plan is a guess."""


class LightsLog:
    """Turns what lights show into rows, whenever a colour changes."""

    def __init__(self, drive_frame: LocalFrame) -> None:
        self._frame = drive_frame
        self._heads: dict[str, dict[str, Array]] = {}
        """By World and group, the places (N, 3) of the heads."""
        self._shown: tuple[str | None, tuple[tuple[str, Colour], ...]] = (None, ())

    def know(self, world: World) -> None:
        """Take the heads of a World."""
        tops = signal_tops(world, drive_frame=self._frame)
        groups = np.array([signal.group_id for signal in world.signals])
        self._heads[world.id] = {group: tops[groups == group] for group in set(groups.tolist())}

    def rows(self, shown: ShownLights, drive_ns: int) -> list[Row]:
        """Return all heads whose colour is known, none where nothing has changed."""
        heads = self._heads.get(shown.world_id or "", {})
        lit = tuple(
            (light.group_id, _seen(COLOURS[light.colour], light.binds_car))
            for light in shown.lights
            if light.colour in COLOURS and light.group_id in heads
        )
        before, self._shown = self._shown, (shown.world_id, lit)
        if before == self._shown or not (lit or before[1]):
            return []
        if not lit:
            return [Row(PATH, drive_ns, rr.Clear(recursive=False))]
        places = [heads[group] for group, _ in lit]
        colours = [colour for group, colour in lit for _ in heads[group]]
        points = rr.Points3D(np.concatenate(places), colors=colours, radii=0.45)
        return [Row(PATH, drive_ns, points)]


def _seen(colour: Colour, binds_car: bool) -> Colour:
    red, green, blue = (round(part * (1.0 if binds_car else FAINT)) for part in colour)
    return red, green, blue
