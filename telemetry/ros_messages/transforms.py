"""Transforms between the frames of a car (TFMessage)."""

from __future__ import annotations

from typing import Any

import numpy as np

from foretwin.contracts.arrays import Array
from foretwin.contracts.drive import Vector3


class TransformTree:
    """The frames of TFMessages: the last transform of each child to its parent counts."""

    def __init__(self) -> None:
        self._parents: dict[str, tuple[str, Array]] = {}

    def add(self, ros: Any) -> None:
        """Take in one TFMessage."""
        for one in ros.transforms:
            parent, child = one.header.frame_id.lstrip("/"), one.child_frame_id.lstrip("/")
            self._parents[child] = (parent, _parent_from_child(one.transform))

    def put(self, child: str, *, within: str, place_m: Vector3) -> None:
        """Take in that `child` stands at a place in `within`, with the same axes."""
        matrix = np.eye(4)
        matrix[:3, 3] = place_m
        self._parents[child.lstrip("/")] = (within.lstrip("/"), matrix)

    def place_of(self, child: str, *, within: str) -> Vector3 | None:
        """Return the origin of `child` in the axes of `within`, metres; None where unconnected."""
        found = self.within_from(child, within)
        if found is None:
            return None
        x, y, z = found[:3, 3].tolist()
        return (x, y, z)

    def turn_of(self, child: str, *, within: str) -> Array | None:
        """Return the matrix (3, 3) from the axes of `child` into those of `within`, or None."""
        found = self.within_from(child, within)
        return None if found is None else found[:3, :3]

    def within_from(self, child: str, within: str) -> Array | None:
        """Return the matrix (4, 4) from `child` into `within`, None where unconnected."""
        child, within = child.lstrip("/"), within.lstrip("/")
        to_child, to_within = self._to_root(child), self._to_root(within)
        if child == within:
            return np.eye(4)
        shared = next((name for name in to_child if name in to_within), None)
        if shared is None:
            return None
        return np.asarray(np.linalg.solve(to_within[shared], to_child[shared]), dtype=np.float64)

    def _to_root(self, name: str) -> dict[str, Array]:
        """Return the transforms into each ancestor of a frame, nearest first."""
        found = {name: np.eye(4)}
        while name in self._parents:
            parent, step = self._parents[name]
            if parent in found:  # a circle: what lies within it has no root
                break
            found[parent] = step @ found[name]
            name = parent
        return found


def _parent_from_child(transform: Any) -> Array:
    return matrix_of(transform.rotation, transform.translation)


def matrix_of(rotation: Any, place: Any) -> Array:
    """Return the matrix (4, 4) of a quaternion, of whatever length, and a place in metres."""
    q, at = rotation, place
    x, y, z, w = np.array([q.x, q.y, q.z, q.w]) / (np.linalg.norm([q.x, q.y, q.z, q.w]) or 1.0)
    matrix = np.eye(4)
    matrix[:3, :3] = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ]
    matrix[:3, 3] = (at.x, at.y, at.z)
    return matrix
