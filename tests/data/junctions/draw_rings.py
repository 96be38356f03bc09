"""Roundabouts and what is like them."""

from __future__ import annotations

from tests.data.junctions.drawing import ENGLISH, GERMAN, LEEDS, LYON, Drawing, Point, ring

OUT: dict[str, Point] = {"N": (0, 1), "E": (1, 0), "S": (0, -1), "W": (-1, 0)}


def _spokes(
    d: Drawing,
    letters: str,
    radius_x_m: float,
    radius_y_m: float,
    names: dict[str, str],
    highway: str,
) -> None:
    for letter in letters:
        x, y = OUT[letter]
        near = (radius_x_m * x + 0.0, radius_y_m * y + 0.0)
        d.way(names[letter], highway, (130.0 * x, 130.0 * y), near)


def roundabout(d: Drawing) -> None:
    d.way("", "tertiary", *ring(16, 16), junction="roundabout")
    _spokes(d, "NESW", 16, 16, GERMAN, "tertiary")


def circular(d: Drawing) -> None:
    d.way("Place Ronde", "tertiary", *ring(30, 30), junction="circular", oneway="yes")
    names = {"N": "Rue du Nord", "E": "Rue du Levant", "S": "Rue du Midi", "W": "Rue du Couchant"}
    _spokes(d, "NESW", 30, 30, names, "tertiary")


def mini_roundabout(d: Drawing) -> None:
    d.arms("WES", "tertiary")
    d.node(0, 0, highway="mini_roundabout", direction="clockwise")


def oval(d: Drawing) -> None:
    d.way("", "secondary", *ring(34, 15), junction="roundabout")
    _spokes(d, "NEW", 34, 15, GERMAN, "secondary")


def flared(d: Drawing) -> None:
    """A two-lane ring; three arms split around islands, the north is a dual carriageway."""
    circle = ring(24, 24)
    d.way("", "primary", *circle, junction="roundabout", lanes="2")
    two = {"oneway": "yes", "lanes": "2"}
    d.way("Nordring", "primary", (-7, 130), (-7, 40), circle[7], **two)
    d.way("Nordring", "primary", circle[5], (7, 40), (7, 130), **two)
    for name, first, (x, y) in (
        ("Westweg", 12, (-1, 0)),
        ("Südweg", 18, (0, -1)),
        ("Ostweg", 0, (1, 0)),
    ):
        d.way(name, "secondary", (130.0 * x, 130.0 * y), (46.0 * x, 46.0 * y), lanes="2")
        d.way(name, "secondary", (46.0 * x, 46.0 * y), circle[(first + 1) % 24], oneway="yes")
        d.way(name, "secondary", circle[(first - 1) % 24], (46.0 * x, 46.0 * y), oneway="yes")


def left_hand_roundabout(d: Drawing) -> None:
    d.way("", "secondary", *ring(18, 18, clockwise=True), junction="roundabout")
    _spokes(d, "NES", 18, 18, ENGLISH, "secondary")


DRAWINGS = {
    "17_roundabout": roundabout,
    "18_circular": (circular, LYON),
    "19_mini_roundabout": (mini_roundabout, LEEDS),
    "20_oval_roundabout": oval,
    "21_flared_roundabout": flared,
    "22_left_hand_roundabout": (left_hand_roundabout, LEEDS),
}
