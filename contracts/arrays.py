"""The one array type of the messages: a numpy float array, sent as its raw bytes."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]
"""Float64 array; shapes stand in the docstring of each field."""

Array32 = npt.NDArray[np.float32]
"""Float32 array, for trajectories on the wire."""


def array_to_wire(array: np.ndarray[Any, Any]) -> tuple[str, tuple[int, ...], bytes]:
    """Return (dtype, shape, bytes) of an array, little-endian and C-contiguous."""
    contiguous = np.ascontiguousarray(array)
    if contiguous.dtype.byteorder == ">":
        contiguous = contiguous.astype(contiguous.dtype.newbyteorder("<"))
    return contiguous.dtype.str, contiguous.shape, contiguous.tobytes()


def array_from_wire(dtype: str, shape: tuple[int, ...], data: bytes) -> np.ndarray[Any, Any]:
    """Return the read-only array of `array_to_wire`'s result; ValueError where sizes disagree."""
    kind = np.dtype(dtype)
    if kind.kind not in "fiub":
        raise ValueError(f"array of type {dtype!r} is refused; numbers and booleans only")
    return np.frombuffer(data, dtype=kind).reshape(shape)
