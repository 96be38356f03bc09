"""The one array type of the messages: a numpy float array, sent as its raw bytes."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]
"""Float64 array; shapes stand in the docstring of each field."""

Array32 = npt.NDArray[np.float32]
"""Float32 array, for trajectories on the wire."""

Flags = npt.NDArray[np.bool_]
"""Booleans of an array's elements or rows."""

Indices = npt.NDArray[np.intp]
"""Places in another array."""

Stamps = npt.NDArray[np.int64]
"""Nanoseconds of a vehicle's clock."""

_FLOAT64 = np.dtype("<f8")
_WIRE_TYPES = ("<f8", "<f4", "<i8", "<i4", "|u1", "|b1")


def array_to_wire(array: np.ndarray[Any, Any]) -> tuple[str, tuple[int, ...], bytes]:
    """Return (dtype, shape, bytes) of an array, little-endian and C-contiguous."""
    # A World has tens of thousands of small arrays: what numpy is asked costs more than the bytes.
    if array.dtype is _FLOAT64 and array.ndim:
        return "<f8", array.shape, array.tobytes()
    contiguous = np.ascontiguousarray(array)
    if contiguous.dtype.byteorder == ">":
        contiguous = contiguous.astype(contiguous.dtype.newbyteorder("<"))
    return contiguous.dtype.str, contiguous.shape, contiguous.tobytes()


def array_from_wire(dtype: str, shape: tuple[int, ...], data: bytes) -> np.ndarray[Any, Any]:
    """Return the read-only array of `array_to_wire`'s result; ValueError where sizes disagree."""
    if dtype not in _WIRE_TYPES:
        raise ValueError(f"array of type {dtype!r} is refused; known: {', '.join(_WIRE_TYPES)}")
    return np.frombuffer(data, dtype=dtype).reshape(shape)
