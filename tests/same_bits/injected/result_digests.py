"""Digests of what watched functions return, quantity by quantity, without the product's own.

A quantity is found by the first of its paths that leads somewhere, so that a renamed attribute
needs one more path here. Arrays count by shape and bits. NaN is NaN whatever its bits, and booleans
are integers, so that only the type of real numbers matters.
"""

from __future__ import annotations

import dataclasses
import hashlib
import struct
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

Digests = dict[str, str]

JOB_KEY: tuple[tuple[str, tuple[str, ...]], ...] = (
    ("round", ("result.round_id", "job.round_id")),
    ("job", ("result.job_index", "job.job_index")),
    ("world", ("result.world_id", "job.world_id")),
    ("variants", ("result.variant_indices", "job.variants[].index", "job.futures[].index")),
)
QUANTITIES: tuple[tuple[str, tuple[str, ...]], ...] = (
    ("states", ("result.trajectory.states",)),
    ("time_s", ("result.trajectory.time_s",)),
    ("collided", ("result.outcome.collided",)),
    ("collision_time_s", ("result.outcome.collision_time_s",)),
    ("collision_with", ("result.outcome.collision_with",)),
    ("min_clearance_m", ("result.outcome.min_clearance_m",)),
    ("progress_m", ("result.outcome.progress_m",)),
    ("valid", ("result.outcome.valid",)),
    ("road_users.poses", ("result.road_users.poses",)),
    ("road_users.speed_mps", ("result.road_users.speed_mps",)),
    ("road_users.size_m", ("result.road_users.size_m",)),
)
KINDS, KIND_NAMES = ("result.road_users.kinds",), ("result.road_users.kind_names",)
METRICS = ("result.metrics",)
ACCIDENTS = ("result.accidents",)
ACCIDENT_NUMBERS = (
    "future", "road_user", "time_s", "point_m", "angle_rad", "closing_mps", "ego_delta_v_mps",
    "user_delta_v_mps",
)  # fmt: skip
COLLISION_CODES = {"": 0, "none": 0, "nothing": 0, "road_user": 1, "static": 2}
"""What words for `collision_with` mean as numbers."""
_MISSING = object()


def describe_job(arguments: Mapping[Any, Any], result: Any) -> dict[str, Any]:
    """Return the identity of a job and the digests of what was found for it."""
    things = {"job": arguments.get(0, arguments.get("job")), "result": result}
    key = " ".join(f"{name} {_words(find(things, paths))}" for name, paths in JOB_KEY)
    parts = {}
    for name, paths in QUANTITIES:
        value = find(things, paths)
        if value is not _MISSING:
            parts[name] = array_digest(_codes(value))
    kinds, names = find(things, KINDS), find(things, KIND_NAMES)
    if kinds is not _MISSING and names is not _MISSING:
        parts["road_users.kinds"] = content_digest([names[kind] for kind in np.ravel(kinds)])
    metrics = find(things, METRICS)
    if metrics is not _MISSING:
        parts |= {f"metric {name}": array_digest(values) for name, values in metrics.items()}
    accidents = find(things, ACCIDENTS)
    # A job that does not ask for accidents has none, which says nothing about them.
    if accidents is not _MISSING and getattr(things["job"], "accidents", True):
        rows = [_numbers(accident) for accident in accidents]
        parts["accidents"] = array_digest(np.array(rows, dtype=np.float64))
    return {"key": key, "parts": parts}


def describe_world(_: Mapping[Any, Any], world: Any) -> dict[str, Any]:
    """Return which World this is, its id, and the digest of each of its fields."""
    key = f"{world.map_sha256[:8]} {world.intersection.id} {world.radius_m}"
    fields = {name: value for name, value in _fields(world) if name != "id"}
    content = {f"content {name}": content_digest(value) for name, value in fields.items()}
    return {"key": key, "parts": {"id": world.id} | content}


DESCRIBE: dict[str, Callable[[Mapping[Any, Any], Any], dict[str, Any]]] = {
    "run_job": describe_job,
    "build_world": describe_world,
    "build_region": describe_world,
}
"""By the name of the watched function."""


def find(things: Mapping[str, Any], paths: tuple[str, ...]) -> Any:
    """Return what the first path leads to that leads anywhere; `a[].b` is the b of each a."""
    for path in paths:
        value: Any = things
        for step in path.split("."):
            name = step.removesuffix("[]")
            if isinstance(value, Mapping):
                value = value.get(name, _MISSING)
            elif isinstance(value, list):
                value = [getattr(one, name, _MISSING) for one in value]
            else:
                value = getattr(value, name, _MISSING)
            if value is not _MISSING and step.endswith("[]"):
                value = list(value)
        if value is not _MISSING:
            return value
    return _MISSING


def array_digest(values: Any) -> str:
    """Return the digest of an array's shape, type and bits."""
    return hashlib.sha256(_array_bytes(np.asarray(values))).hexdigest()[:32]


def content_digest(value: Any) -> str:
    """Return the digest of nested structs by the names of their fields, not of their classes."""
    digest = hashlib.sha256()
    _feed(digest.update, value)
    return digest.hexdigest()[:32]


def _array_bytes(array: np.ndarray[Any, Any]) -> bytes:
    if array.dtype.kind in "bui":
        array = array.astype("<i8")
    elif array.dtype.kind == "f":
        array = np.where(np.isnan(array), array.dtype.type(np.nan), array)
    else:
        raise TypeError(f"an array of {array.dtype} has no bits to compare")
    return f"{array.dtype.str} {array.shape} ".encode() + np.ascontiguousarray(array).tobytes()


def _feed(update: Callable[[bytes], None], value: Any) -> None:
    if isinstance(value, np.ndarray):
        update(b"a" + _array_bytes(value))
    elif isinstance(value, float):
        update(b"f" + struct.pack("<d", value))
    elif value is None or isinstance(value, (bool, int, str, bytes)):
        update(f"{type(value).__name__} {value!r};".encode())
    elif isinstance(value, np.generic):
        _feed(update, value.item())
    elif isinstance(value, Mapping):
        update(f"m{len(value)};".encode())
        for name in sorted(value, key=repr):
            _feed(update, name)
            _feed(update, value[name])
    elif isinstance(value, (tuple, list)):
        update(f"t{len(value)};".encode())
        for one in value:
            _feed(update, one)
    else:
        for name, one in _fields(value):
            update(f"s{name};".encode())
            _feed(update, one)


def _fields(value: Any) -> list[tuple[str, Any]]:
    names = getattr(value, "__struct_fields__", None)
    if names is None:
        names = [field.name for field in dataclasses.fields(value)]
    found = [(name, getattr(value, name)) for name in sorted(names)]
    # A field that is not set is not there: it is not written either.
    return [(name, one) for name, one in found if type(one).__name__ != "UnsetType"]


def _codes(value: Any) -> Any:
    array = np.asarray(value)
    if array.dtype.kind not in "UO":
        return array
    return np.array([COLLISION_CODES[word] for word in array.tolist()])


def _numbers(accident: Any) -> list[float]:
    numbers = [np.asarray(getattr(accident, name), np.float64) for name in ACCIDENT_NUMBERS]
    return np.concatenate([number.ravel() for number in numbers]).tolist()


def _words(value: Any) -> str:
    """Return what names a job; numbers in a row as first-last."""
    if value is _MISSING:
        raise LookupError("no path leads to what names a job: see JOB_KEY")
    if not isinstance(value, (tuple, list)):
        return str(value)
    numbers = [int(one) for one in value]
    first, last = numbers[0], numbers[-1]
    in_a_row = numbers == list(range(first, last + 1)) and len(numbers) > 1
    return f"{first}-{last}" if in_a_row else ",".join(map(str, numbers))
