"""What OpenDRIVE writes as cubics over arc length: widths, offsets, heights."""

from __future__ import annotations

from typing import NamedTuple

from foretwin.contracts.elevation import HeightProfile

_LEVEL = 1e-9
"""Smaller grades are none."""


class Cubic(NamedTuple):
    """a + b s + c s² + d s³, as widths and offsets are written."""

    a: float
    b: float = 0.0
    c: float = 0.0
    d: float = 0.0

    @staticmethod
    def between(start: float, end: float, length_m: float) -> Cubic:
        """Return the change from `start` to `end` that is level at both ends."""
        rise = end - start
        if abs(rise) < 1e-9:
            return Cubic(start)
        return Cubic(start, 0.0, 3.0 * rise / length_m**2, -2.0 * rise / length_m**3)

    def at(self, s_m: float) -> float:
        """Return the value at arc length `s_m`."""
        return self.a + s_m * (self.b + s_m * (self.c + s_m * self.d))


class Rise(NamedTuple):
    """Heights along a road: cubics that follow each other, by where they begin."""

    pieces: tuple[tuple[float, Cubic], ...]

    @staticmethod
    def between(start: float, end: float, length_m: float) -> Rise:
        """Return the rise from one height to another that is level at both ends."""
        return Rise(((0.0, Cubic.between(start, end, length_m)),))

    @staticmethod
    def of(profile: HeightProfile, length_m: float) -> Rise:
        """Return a profile, stretched to the length of the curve that the road is drawn as."""
        scale = length_m / max(float(profile.along_m[-1]), 1e-9)
        pieces = zip(
            (profile.along_m[:-1] * scale).tolist(), profile.cubics().tolist(), strict=True
        )
        return Rise(
            tuple(
                (s, Cubic(a, b / scale, c / scale**2, d / scale**3)) for s, (a, b, c, d) in pieces
            )
        )

    @staticmethod
    def joining(start: float, out: float, end: float, into: float, length_m: float) -> Rise:
        """Return the rise from one height and grade to another."""
        mean = (end - start) / length_m
        if max(abs(out), abs(into), abs(mean)) < _LEVEL:
            return Rise(((0.0, Cubic(start)),))
        c, d = (3.0 * mean - 2.0 * out - into), (out + into - 2.0 * mean)
        return Rise(((0.0, Cubic(start, out, c / length_m, d / length_m**2)),))

    def _piece(self, s_m: float) -> tuple[float, Cubic]:
        return max((p for p in self.pieces if p[0] <= s_m), default=self.pieces[0])

    def at(self, s_m: float) -> float:
        """Return the height at arc length `s_m`."""
        begin, cubic = self._piece(s_m)
        return cubic.at(s_m - begin)

    def slope_at(self, s_m: float) -> float:
        """Return the grade at arc length `s_m`."""
        begin, cubic = self._piece(s_m)
        s = s_m - begin
        return cubic.b + s * (2.0 * cubic.c + s * 3.0 * cubic.d)
