"""Small pieces of CommonRoad XML."""

from __future__ import annotations

from typing import Any

import numpy as np
from lxml import etree

from foretwin.contracts.arrays import Array


class IdCounter:
    """Ids of CommonRoad objects, counted up from 1: all kinds share one range."""

    def __init__(self) -> None:
        self._last = 0

    def new(self) -> int:
        """Return the next id."""
        self._last += 1
        return self._last


def child(parent: Any, tag: str, text: object = None) -> Any:
    """Add and return an element, with text where there is any."""
    element = etree.SubElement(parent, tag)
    if text is not None:
        element.text = str(text)
    return element


def ref(parent: Any, tag: str, number: int) -> Any:
    """Add and return an element that names another by its id."""
    return etree.SubElement(parent, tag, ref=str(number))


def points(parent: Any, line: Array) -> None:
    """Add the points (N, 2) of a line in metres."""
    for x, y in np.asarray(line, dtype=np.float64).tolist():
        point = etree.SubElement(parent, "point")
        etree.SubElement(point, "x").text = f"{x:.3f}"
        etree.SubElement(point, "y").text = f"{y:.3f}"


def position(parent: Any, xy_m: Array) -> None:
    """Add the exact place (2,) of a sign or light in metres."""
    points(child(parent, "position"), np.asarray(xy_m)[None, :2])


def put(xml: Any, element: Any) -> None:
    """Write an element of the root on a line of its own."""
    element.tail = "\n"
    xml.write(element)
