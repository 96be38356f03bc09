"""Equally spaced nodes of a path: tables of them, what lies between, and how cars cut corners."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from foretwin.contracts.arrays import Array

_EASED_NODES = 2
"""A car cuts corners by as much as means over so many nodes on either side do: it is so long."""


class NodePlace(NamedTuple):
    """Places between a path's nodes: which is before (…), what share (…) of the way to the next."""

    node: npt.NDArray[np.intp]
    share: Array


def cut_corners(values: Array) -> Array:
    """Return means of values (M,) over a car's length; both ends are straight."""
    k = _EASED_NODES
    whole = np.pad(values, k, mode="reflect", reflect_type="odd")
    sums = np.cumsum(np.pad(whole, (1, 0)))
    return np.asarray((sums[2 * k + 1 :] - sums[: -2 * k - 1]) / (2 * k + 1))


def headings(x_m: Array, y_m: Array) -> Array:
    """Return (M,) headings of nodes without jumps."""
    return np.unwrap(np.arctan2(np.gradient(y_m), np.gradient(x_m)))


def node_table(x_m: Array, y_m: Array, heading: Array) -> Array:
    """Return (8, M) nodes and the unit vectors to their left, by headings, and the steps of these.

    A table has a row for each quantity: a look-up gives columns that lie in order.
    """
    return with_steps(np.stack([x_m, y_m, -np.sin(heading), np.cos(heading)]))


def with_steps(values: Array) -> Array:
    """Return (2 K, M): values (K, M) at nodes, and their steps to the next."""
    return np.concatenate([values, np.diff(values, append=values[:, -1:])])


def between(table: Array, place: NodePlace) -> Array:
    """Return values (K, …) at places, from a table (2 K, M) of them with their steps."""
    found = table.take(place.node, axis=1, mode="clip")
    half = len(table) // 2
    steps = found[half:]
    steps *= place.share
    steps += found[:half]
    return np.asarray(steps)


def prolonged(at: Array, arc: Array, values: Array) -> Array:
    """Interpolate `values` over `arc`, going on straight beyond both ends."""
    inside = np.interp(at, arc, values)
    first = (values[1] - values[0]) / (arc[1] - arc[0])
    last = (values[-1] - values[-2]) / (arc[-1] - arc[-2])
    inside = np.where(at < arc[0], values[0] + (at - arc[0]) * first, inside)
    return np.asarray(np.where(at > arc[-1], values[-1] + (at - arc[-1]) * last, inside))
