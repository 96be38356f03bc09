"""Lines, areas and words as SVG: units of a tenth of a metre, north up."""

from __future__ import annotations

from collections.abc import Iterable
from html import escape

import numpy as np
import shapely

from foretwin.contracts.arrays import Array
from foretwin.contracts.terminal import plain

UNITS_PER_M = 10.0
_TOLERANCE_M = 0.08


class Canvas:
    """A rectangle of ground, in metres west, south, east, north, and what is drawn on it."""

    def __init__(self, west_m: float, south_m: float, east_m: float, north_m: float) -> None:
        self._box = (west_m, south_m, east_m, north_m)
        self._parts: list[str] = []
        self._leads_on = False
        """Whether something drawn is a link."""

    @property
    def width_m(self) -> float:
        """How much ground it shows from west to east."""
        return self._box[2] - self._box[0]

    @property
    def height_m(self) -> float:
        """How much ground it shows from south to north."""
        return self._box[3] - self._box[1]

    def area(
        self, rings: Iterable[Array], style: str, *, tolerance_m: float = _TOLERANCE_M
    ) -> None:
        """Draw a polygon: its outline (N, 2) and its holes; what is outside is cut off."""
        outline, *holes = rings
        if len(outline) < 3:
            return
        shape = shapely.make_valid(
            shapely.Polygon(outline, [hole for hole in holes if len(hole) > 2])
        )
        shape = shapely.clip_by_rect(shape.simplify(tolerance_m), *self._box)
        d = "".join(
            self._path(np.asarray(ring.coords)[:-1]) + "Z"
            for polygon in shapely.get_parts(shape)
            if polygon.geom_type == "Polygon" and not polygon.is_empty
            for ring in (polygon.exterior, *polygon.interiors)
        )
        if d:
            self._parts.append(f'<path d="{d}" fill-rule="evenodd" {style}/>')

    def line(self, xy_m: Array, style: str, *, title: str = "") -> None:
        """Draw a line (N, 2); a `title` is shown where the pointer rests on it."""
        d = self._line_path(xy_m)
        if not d:
            return
        inner = f"><title>{escape(plain(title))}</title></path>" if title else "/>"
        self._parts.append(f'<path d="{d}" fill="none" {style}{inner}')

    def lines(self, many: Iterable[Array], style: str) -> None:
        """Draw lines (N, 2) of one style as one element."""
        d = "".join(self._line_path(one) for one in many)
        if d:
            self._parts.append(f'<path d="{d}" fill="none" {style}/>')

    def dots(self, xy_m: Array, radius_m: float, style: str) -> None:
        """Draw dots at points (N, 2)."""
        for x, y in self._units(xy_m):
            self._parts.append(
                f'<circle cx="{x}" cy="{y}" r="{radius_m * UNITS_PER_M:.0f}" {style}/>'
            )

    def words(self, xy_m: Array, text: str, size_m: float, style: str, *, to: str = "") -> None:
        """Write a text at a point; `to` is an anchor of the report that it leads to."""
        ((x, y),) = self._units(np.asarray(xy_m)[None])
        size = round(size_m * UNITS_PER_M)
        said = f'<text x="{x}" y="{y}" font-size="{size}" {style}>{escape(plain(text))}</text>'
        self._parts.append(f'<a href="#{to}">{said}</a>' if to else said)
        self._leads_on |= bool(to)

    def scale_bar(self) -> None:
        """Draw how long a round number of metres is, in the lower left corner."""
        west, south, _, _ = self._box
        long_m = max(
            n for n in (5, 10, 20, 50, 100, 200, 500, 1000, 2000) if n <= 0.25 * self.width_m
        )
        start = np.array([west + 0.03 * self.width_m, south + 0.035 * self.width_m])
        ends = start + np.array([[0.0, 0.0], [long_m, 0.0]])
        wide = 0.004 * self.width_m * UNITS_PER_M
        self.lines([ends], f'stroke="#1c2530" stroke-width="{wide:.0f}"')
        above = start + np.array([0.0, 0.012 * self.width_m])
        self.words(above, f"{long_m} m", 0.022 * self.width_m, 'fill="#1c2530"')

    def svg(self, label: str, ground: str) -> str:
        """Return all of it as one SVG element; `label` is for who cannot see it.

        What is an image to who reads the page aloud has no links: with some, it is a group.
        """
        role = "group" if self._leads_on else "img"
        wide, high = (round(one * UNITS_PER_M) for one in (self.width_m, self.height_m))
        return (
            f'<svg viewBox="0 0 {wide} {high}" role="{role}" '
            f'aria-label="{escape(plain(label), quote=True)}" '
            f'font-family="system-ui, DejaVu Sans, sans-serif">'
            f'<rect width="{wide}" height="{high}" fill="{ground}"/>{"".join(self._parts)}</svg>'
        )

    def _units(self, xy_m: Array) -> list[tuple[int, int]]:
        west, _, _, north = self._box
        x = np.round((xy_m[:, 0] - west) * UNITS_PER_M).astype(int)
        y = np.round((north - xy_m[:, 1]) * UNITS_PER_M).astype(int)
        return list(zip(x.tolist(), y.tolist(), strict=True))

    def _path(self, xy_m: Array) -> str:
        points = self._units(xy_m)
        (x, y), rest = points[0], points[1:]
        said = [f"M{x} {y}"]
        if rest:
            steps = []
            for to_x, to_y in rest:
                steps.append(f"{to_x - x} {to_y - y}")
                x, y = to_x, to_y
            said.append("l" + " ".join(steps))
        return "".join(said).replace(" -", "-")

    def _line_path(self, xy_m: Array) -> str:
        known = xy_m[np.isfinite(xy_m).all(axis=1)]
        if len(known) < 2:
            return ""
        cut = shapely.clip_by_rect(shapely.LineString(known).simplify(_TOLERANCE_M), *self._box)
        return "".join(
            self._path(np.asarray(part.coords))
            for part in shapely.get_parts(cut)
            if part.geom_type == "LineString" and not part.is_empty
        )
